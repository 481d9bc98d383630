"""Plan of a batch: the captures, their identity, the settings, the shard to run."""
