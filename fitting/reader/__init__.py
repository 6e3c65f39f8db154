"""From the bytes of a measured file to long columns of numbers, or a refusal that helps.

In the order in which a file passes through:

    lines, cells, header, table             bytes -> lines -> cells -> a table with line numbers
    formats, film_sense, jcamp, perkin_elmer, spectraray, spectrum_header, woollam
                                            files that are no plain tables, made into such
    vocabulary, names, options, columns     what the user and the header say that a column is
    unread_columns                          those that are not read, and may hold something of use
    evidence                                what comments, settings and the file name say
    units, reading, axes, light             angles, wavelengths, polarization
    scales                                  percent or fraction, degrees or radians; the errors
    own_export                              a table that this package wrote
    longform                                one datum per row
"""
