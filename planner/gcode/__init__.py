"""The control's language: addresses, words, blocks, programs, dialects, reader and writer; meaning is elsewhere."""
