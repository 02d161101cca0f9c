"""What is learnt, while sliding, of the mount, the clock and motions of the object."""
