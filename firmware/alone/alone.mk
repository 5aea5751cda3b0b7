# The program that drives alone:  make alone SERVO=agent.c, a controller that `pneumarm deploy` wrote.
ALONE := alone/main.c alone/control.c alone/limits.c alone/lines.c alone/reference.c
ALONE += latches.c pulses.c converter.c valves.c clock.c uart.c reset.c
ALONE_HEADERS := alone/control.h alone/limits.h alone/lines.h alone/reference.h alone/servo.h alone/products.h

.PHONY: alone
alone: $(BUILD)/alone.hex

$(BUILD)/alone.elf: $(ALONE) $(HEADERS) $(ALONE_HEADERS) $(SERVO) alone/alone.mk
	mkdir -p $(BUILD)
	$(CC) $(CFLAGS) -I. -Ialone -DFEW_CHANNELS=3 -DSERVO_REAL=float -DSERVO_PRODUCTS='"products.h"' -DSERVO='"$(abspath $(SERVO))"' -o $@ $(ALONE) -lm

$(BUILD)/alone.hex: $(BUILD)/alone.elf
	avr-objcopy -O ihex -R .eeprom $< $@
	avr-size -C --mcu=$(MCU) $<
