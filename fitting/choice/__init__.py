"""The choice among several models or samples: the smallest that the data do not contradict."""
