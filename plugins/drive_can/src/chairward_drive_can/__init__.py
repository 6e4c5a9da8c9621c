"""CAN wheelchair controllers: R-Net, any DBC file, CANopen CiA 402."""
