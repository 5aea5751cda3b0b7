/* An Arduino Uno or Nano, or a clone: an ATmega328P at 16 MHz. */
#pragma once
#include <avr/io.h>
#include <stdbool.h>
#include <stdint.h>

/* Interrupts of the line to the host. */
#define UART_RECEIVED USART_RX_vect
#define UART_EMPTY USART_UDRE_vect

/* Pins without a use are pulled up, so that they do not float. */
#define UNUSED_D (_BV(PD2) | _BV(PD3))
#define UNUSED_B _BV(PB4)
#define LIGHT _BV(PB5)

/* Make the valves' pins and the light's outputs, all of them off. */
static inline void board_start(void)
{
	/* Levels first: no pin may be driven high on the way. */
	PORTD = UNUSED_D;
	PORTB = UNUSED_B;
	DDRD = 0xf0;
	DDRB = 0x0f | LIGHT;
}

/* Set the valves' eight pins: the lower half of the byte is D4 to D7, the upper half D8 to D11. */
static inline void board_write(uint8_t pins)
{
	PORTD = UNUSED_D | (uint8_t)(pins << 4);
	PORTB = (PORTB & (UNUSED_B | LIGHT)) | pins >> 4;
}

/* Switch the light, D13. */
static inline void board_light(bool on)
{
	/* One instruction each, so that an interrupt that sets valves cannot come in between. */
	if (on)
		PORTB |= LIGHT;
	else
		PORTB &= ~LIGHT;
}
