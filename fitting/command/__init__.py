"""The parts of the command ``fresnel-fit`` that only some of its uses need."""
