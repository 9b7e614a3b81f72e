"""The subcommands of `vergence`, one file each."""
