"""Other methods on the same slides: the filter of the paper, registration of the contact cloud, odometry alone."""
