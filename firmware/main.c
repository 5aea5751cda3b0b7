/* The microcontroller's program: it measures, it holds the valves, and it vents where it must. See PROTOCOL.md.
 *
 * Three things go on at once. The converter's interrupt samples all sensors and cuts over-pressure off. The tick, once
 * a millisecond, looks after the dead-man and the converter; another timer ends pulses. The main loop answers the
 * host; nothing that protects the arm waits for it, and if it hangs the watchdog resets the program, which vents. */
#include <avr/interrupt.h>
#include <avr/wdt.h>

#include "clock.h"
#include "converter.h"
#include "latches.h"
#include "reset.h"
#include "session.h"
#include "uart.h"
#include "valves.h"

/* The two interrupts that come before that of the line. Each first takes a byte that waits: it could else wait for a
 * conversion and for both of them, one after the other, and another two bytes would come meanwhile. */
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

/* An interrupt that nobody wants: something disturbed a register. By default the program would then jump to its
 * beginning, the registers as disturbed as they are and no cause to tell; the watchdog resets them all, and is told. */
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
	session_start();
	sei();
	reset_count();
	for (;;) {
		uint8_t byte;
		/* Fed only when the tick lives: without it there would be no dead-man. */
		if (clock_ticked())
			wdt_reset();
		/* No request is begun whose reply has no room; the others wait in their ring. */
		if (uart_has_room() && uart_receive(&byte))
			session_byte(byte);
	}
}
