"""Maps: many pixels' curves on disk, fitted in blocks; the store on disk is the state of the work."""
