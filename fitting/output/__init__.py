"""What a person reads and looks at: tables, pictures, pages, and the files that hold them."""
