"""The PIC16F877A motor controller over a serial line, with its firmware."""
