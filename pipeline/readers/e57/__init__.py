"""The E57 reader: pages and checksums, XML, scans with their poses, binary sections."""
