"""`fresnel_jax`: values, derivatives and calls of every public function."""
