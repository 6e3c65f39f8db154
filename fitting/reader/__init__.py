"""From the bytes of a measured file to long columns of numbers, or a refusal that helps.

text, cells, table: bytes -> lines -> cells -> a table with line numbers; instruments: files that
are no plain tables. vocabulary, names, options, remarks: what words, a header, the user, comments
and the file name say. columns: which are read; conversion: one datum per row, in one unit.
"""
