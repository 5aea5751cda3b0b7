#include "valves.h"

#include <avr/io.h>

#include "protocol.h"

/* The eight pins as one byte, two bits a muscle like the codes: the lower is the inlet's, the upper the exhaust's.
 * Its lower half is D4 to D7, its upper half D8 to D11. */
#define INLETS 0x55
#define EXHAUSTS 0xaa
/* Pins without a use are pulled up, so that they do not float. */
#define UNUSED_D (_BV(PD2) | _BV(PD3))
#define UNUSED_B _BV(PB4)
#define LIGHT _BV(PB5)

static volatile uint8_t applied = ALL_OUT;

static void write(uint8_t pins)
{
	PORTD = UNUSED_D | (uint8_t)(pins << 4);
	PORTB = (PORTB & (UNUSED_B | LIGHT)) | pins >> 4;
}

static uint8_t pins_of(uint8_t codes)
{
	/* An inlet's pin opens it; an exhaust's pin closes it. */
	return (codes & INLETS) | (~codes & EXHAUSTS);
}

void valves_start(void)
{
	/* Levels first: no pin may be driven high on the way. */
	PORTD = UNUSED_D;
	PORTB = UNUSED_B;
	DDRD = 0xf0;
	DDRB = 0x0f | LIGHT;
}

bool valves_known(uint8_t codes)
{
	return !(codes & codes >> 1 & INLETS);
}

void valves_set(uint8_t codes)
{
	uint8_t before = pins_of(applied), after = pins_of(codes);
	uint8_t staying = before & after & INLETS;
	write(staying | (before & EXHAUSTS)); /* inlets that close */
	write(staying | (after & EXHAUSTS));  /* exhausts */
	write(after);                         /* inlets that open */
	applied = codes;
}

uint8_t valves_applied(void)
{
	return applied;
}

void light_set(bool on)
{
	/* One instruction each, so that an interrupt that sets valves cannot come in between. */
	if (on)
		PORTB |= LIGHT;
	else
		PORTB &= ~LIGHT;
}
