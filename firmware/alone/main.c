/* The program of a board that drives alone: it measures, decides by its own clock, holds the valves, and vents.
 *
 * The converter, the tick and the pulses are those of the other program, with all that they protect; see ../main.c. In
 * the place of a host's requests stand a controller that is part of the program, and lines that a person types. If a
 * decision does not come, the dead-man vents the arm; if the loop hangs, the watchdog does. */
#include <avr/interrupt.h>
#include <avr/wdt.h>

#include "clock.h"
#include "control.h"
#include "converter.h"
#include "latches.h"
#include "lines.h"
#include "reset.h"
#include "uart.h"
#include "valves.h"

ISR(TIMER1_COMPA_vect)
{
	uart_take();
	clock_tick();
	latches_tick();
	converter_tick();
}

ISR(TIMER0_COMPA_vect)
{
	uart_take();
	latches_end_pulses();
}

ISR(BADISR_vect)
{
	latches_disarm();
	for (;;)
		;
}

int main(void)
{
	valves_start();
	clock_start();
	converter_start();
	uart_start();
	control_start();
	sei();
	reset_count();
	lines_start();
	for (;;) {
		uint8_t byte;
		if (clock_ticked())
			wdt_reset();
		control_turn();
		if (uart_has_room() && uart_receive(&byte))
			lines_byte(byte);
	}
}
