"""From the bytes of a measured file to long columns of numbers, or a refusal that helps.

In the order in which a file passes through:

    text, cells, table             bytes -> lines -> cells -> a table with line numbers
    instruments, jcamp             files that are no plain tables, made into such
    vocabulary, names, options     what words, a header and the user say that a column is
    columns                        which are read, and which may not be left out
    remarks                        what comments, settings and the file name say
    conversion                     angles, wavelengths, polarization, values and their errors
    long_form                      one datum per row, with its place in the file
"""
