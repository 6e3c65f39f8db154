"""Tables, pages, pictures and files of a fit."""
