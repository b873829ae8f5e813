//! A Pixhawk 1 in the process: runs the image that is flashed.
