"""Files of the web page: uploads, folders on the machine, and downloads."""
