"""How often fits, intervals, choices and the reader are right, over random cases."""
