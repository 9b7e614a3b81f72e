"""Pictures, plots and tables for reports and the terminal."""
