"""From the bytes of a measured file to long columns of numbers, or a refusal that helps.

In the order in which a file passes through:

    lines, cells, header, woollam, table    bytes -> lines -> cells -> a table with line numbers
    units, names, options, columns          what the user and the header say that a column is
    evidence, rows, axes, light, scales     angles, wavelengths, polarisation, percent or fraction
    longform                                one datum per row
"""
