"""Floor 3: frames through the pipeline into a recording; the command line."""
