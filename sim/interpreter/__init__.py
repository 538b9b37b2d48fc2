"""What each block does: words in, canonical commands out."""
