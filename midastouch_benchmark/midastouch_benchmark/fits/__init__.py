"""Constants of the filter, fitted on training objects by simulation; each is a program of its own."""
