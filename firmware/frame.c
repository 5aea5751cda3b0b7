#include "frame.h"

#include <stdbool.h>

#define CRC_INITIAL 0xffff
#define CRC_FINAL 0xffff

/* Return the CRC-16/X-25 after one more byte, but for its final exclusive-or.
 *
 * The polynomial 0x1021, reflected, has terms at 0, 5 and 12: eight of its steps at once are three shifts of the byte
 * that leaves. */
static uint16_t crc_step(uint16_t crc, uint8_t byte)
{
	uint8_t out = byte ^ (uint8_t)crc;
	out ^= out << 4;
	return (crc >> 8) ^ (uint16_t)out << 8 ^ (uint16_t)out << 3 ^ out >> 4;
}

uint16_t crc16(const uint8_t *bytes, uint8_t length)
{
	uint16_t crc = CRC_INITIAL;
	while (length--)
		crc = crc_step(crc, *bytes++);
	return crc ^ CRC_FINAL;
}

uint8_t cobs_decode(uint8_t *bytes, uint8_t length)
{
	uint8_t read = 0, written = 0;
	while (read < length) {
		uint8_t code = bytes[read++];
		uint8_t run = code - 1;
		if (code == 0 || run > length - read)
			return 0;
		for (; run; run--)
			bytes[written++] = bytes[read++];
		/* A block that is not the last one stands for a zero behind it, unless it is of full length. */
		if (read < length && code != 0xff)
			bytes[written++] = 0;
	}
	return written;
}

/* Return how long the payload of a request is, or -1 where there is no such request. */
static int8_t payload_length(uint8_t type)
{
	switch (type) {
	case CONNECT: return CONNECT_LENGTH;
	case CONFIGURE: return CONFIGURE_LENGTH;
	case ARM: return ARM_LENGTH;
	case DISARM: return DISARM_LENGTH;
	case EXCHANGE: return EXCHANGE_LENGTH;
	case READ: return READ_LENGTH;
	case PULSE: return PULSE_LENGTH;
	default: return -1;
	}
}

uint16_t sum16(const uint8_t *bytes, uint8_t length)
{
	uint8_t sum = 0, sums = 0;
	while (length--)
		sums += sum += *bytes++;
	return sum | (uint16_t)sums << 8;
}

/* What opens valves is said twice: a CRC of 16 bits alone lets one of 65,536 damaged frames through. */
static bool is_said_twice(uint8_t type, const uint8_t *payload)
{
	switch (type) {
	case EXCHANGE: return (payload[0] ^ payload[1]) == 0xff;
	case PULSE: return u16(payload + PULSE_LENGTH - 2) == sum16(payload, PULSE_LENGTH - 2);
	default: return true;
	}
}

static bool is_request(uint8_t *bytes, uint8_t length)
{
	uint8_t decoded = cobs_decode(bytes, length);
	if (decoded < HEADER_LENGTH + CRC_LENGTH)
		return false;
	int8_t expected = payload_length(bytes[0]);
	uint8_t content = decoded - CRC_LENGTH;
	if (expected < 0 || content != HEADER_LENGTH + (uint8_t)expected)
		return false;
	/* Compared, not checked by its residue: a residue lets errors through that lengthen the frame. */
	return u16(bytes + content) == crc16(bytes, content) && is_said_twice(bytes[0], bytes + HEADER_LENGTH);
}

enum frame_event frame_receive(struct receiver *receiver, uint8_t byte)
{
	uint8_t length = receiver->length;
	if (byte) {
		/* The 0x00 has to fit too. What is too long is forgotten up to the next 0x00. */
		if (length < LONGEST_FRAME - 1)
			receiver->bytes[length] = byte;
		if (length < LONGEST_FRAME)
			receiver->length = length + 1;
		return FRAME_NONE;
	}
	receiver->length = 0;
	if (length == 0)
		return FRAME_NONE; /* a host may send 0x00 to end whatever came before */
	if (length >= LONGEST_FRAME || !is_request(receiver->bytes, length))
		return FRAME_CORRUPT;
	return FRAME_TAKEN;
}

void frame_begin(struct sender *sender, void (*out)(const uint8_t *bytes, uint8_t length))
{
	sender->crc = CRC_INITIAL;
	sender->length = 1;
	sender->out = out;
}

static void put(struct sender *sender, uint8_t byte)
{
	if (byte) {
		sender->block[sender->length++] = byte;
	} else {
		sender->block[0] = sender->length;
		sender->out(sender->block, sender->length);
		sender->length = 1;
	}
}

void frame_put(struct sender *sender, uint8_t byte)
{
	sender->crc = crc_step(sender->crc, byte);
	put(sender, byte);
}

void frame_end(struct sender *sender)
{
	uint16_t crc = sender->crc ^ CRC_FINAL;
	put(sender, crc);
	put(sender, crc >> 8);
	sender->block[0] = sender->length;
	sender->block[sender->length++] = 0;
	sender->out(sender->block, sender->length);
}
