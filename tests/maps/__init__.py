"""Maps: cubes fitted block by block into a store; faults of disks, data and processes."""
