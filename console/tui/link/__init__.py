"""What the screens show of the link: a lost one, and who controls the machine."""
