"""Maps: the curves of many pixels, fitted in blocks; a store on disk is the state of the work."""
