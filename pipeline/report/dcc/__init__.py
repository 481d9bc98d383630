"""Digital Calibration Certificate of PTB: DCC 3.3.0, its numbers as D-SI 2.2.1 has them."""
