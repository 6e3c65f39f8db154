"""No more model than the data need: which of several models or samples is taken."""
