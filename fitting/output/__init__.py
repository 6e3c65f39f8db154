"""Tables, pictures, pages and files of a result."""
