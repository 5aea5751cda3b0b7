#include "uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#include "board.h"
#include "protocol.h"

/* Powers of two, so that indices wrap by a mask. An index is one byte: reading it needs no lock, and each is
 * written by one side only. */
#define IN_SIZE 128
#define OUT_SIZE 128

_Static_assert(LONGEST_FRAME <= OUT_SIZE / 2, "a frame must leave while the next one is made");
static volatile uint8_t in_ring[IN_SIZE], in_head, in_tail;
static volatile uint8_t out_ring[OUT_SIZE], out_head, out_tail;
static volatile bool overrun;

void uart_start(void)
{
	_Static_assert(F_CPU % (16 * BAUD) == 0, "the baud rate must be exact");
	UBRR0 = F_CPU / (16 * BAUD) - 1;
	UCSR0A = 0;
	UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
	UCSR0B = _BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0);
}

/* Always inline: the interrupt has fewer registers to save than over a call. */
static inline __attribute__((always_inline)) void take(void)
{
	uint8_t errors = UCSR0A; /* belongs to the byte that is read next */
	if (!(errors & _BV(RXC0)))
		return;
	uint8_t byte = UDR0;
	uint8_t next = (in_head + 1) & (IN_SIZE - 1);
	if (errors & _BV(DOR0))
		overrun = true;
	if (next == in_tail) {
		overrun = true;
		return;
	}
	in_ring[in_head] = byte;
	in_head = next;
}

void uart_take(void)
{
	take();
}

ISR(UART_RECEIVED)
{
	take();
}

ISR(UART_EMPTY)
{
	uint8_t tail = out_tail;
	UDR0 = out_ring[tail];
	tail = (tail + 1) & (OUT_SIZE - 1);
	out_tail = tail;
	/* Off together with the last byte: this interrupt never runs on an empty ring. */
	if (tail == out_head)
		UCSR0B &= ~_BV(UDRIE0);
}

bool uart_receive(uint8_t *byte)
{
	uint8_t tail = in_tail;
	if (tail == in_head)
		return false;
	*byte = in_ring[tail];
	in_tail = (tail + 1) & (IN_SIZE - 1);
	return true;
}

bool uart_has_room(void)
{
	uint8_t used = (out_head - out_tail) & (OUT_SIZE - 1);
	return used <= OUT_SIZE - 1 - LONGEST_FRAME;
}

void uart_send(const uint8_t *bytes, uint8_t length)
{
	uint8_t head = out_head;
	while (length--) {
		out_ring[head] = *bytes++;
		head = (head + 1) & (OUT_SIZE - 1);
	}
	/* With interrupts off: the head and the interrupt's enable bit must not be seen apart. */
	uint8_t status = SREG;
	cli();
	out_head = head;
	UCSR0B |= _BV(UDRIE0);
	SREG = status;
}

bool uart_overrun(void)
{
	/* Cleared only where it was set: what comes in between then says the same. */
	if (!overrun)
		return false;
	overrun = false;
	return true;
}
