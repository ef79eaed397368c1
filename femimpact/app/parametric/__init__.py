"""Parameter studies: axes, cases, blocks on disk, statistics over starts, and where they run."""
