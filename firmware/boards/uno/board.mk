MCU := atmega328p
PROGRAMMER := arduino
# Of the boot loader that flashes: 115200 on an Uno and a Nano of after 2018, 57600 on an older Nano.
FLASH_BAUD ?= 115200
