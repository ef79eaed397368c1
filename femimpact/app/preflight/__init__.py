"""What is warned of before a test is run on a shaker."""
