#include "frame.h"

#include <stdbool.h>

/* CRC-16/X-25 four bits at a time: the remainders of the polynomial 0x1021, reflected. */
static const uint16_t REMAINDERS[16] = {
	0x0000, 0x1081, 0x2102, 0x3183, 0x4204, 0x5285, 0x6306, 0x7387,
	0x8408, 0x9489, 0xa50a, 0xb58b, 0xc60c, 0xd68d, 0xe70e, 0xf78f,
};

uint16_t crc16(const uint8_t *bytes, uint8_t length)
{
	uint16_t crc = 0xffff;
	while (length--) {
		uint8_t byte = *bytes++;
		crc = (crc >> 4) ^ REMAINDERS[(crc ^ byte) & 0x0f];
		crc = (crc >> 4) ^ REMAINDERS[(crc ^ (byte >> 4)) & 0x0f];
	}
	return crc ^ 0xffff;
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
	default: return -1;
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
	uint16_t crc = bytes[content] | (uint16_t)bytes[content + 1] << 8;
	return crc == crc16(bytes, content);
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

uint8_t frame_encode(uint8_t *frame, uint8_t *content, uint8_t length)
{
	uint16_t crc = crc16(content, length);
	content[length++] = crc;
	content[length++] = crc >> 8;
	uint8_t code_at = 0, written = 1;
	for (uint8_t i = 0; i < length; i++) {
		if (content[i]) {
			frame[written++] = content[i];
		} else {
			frame[code_at] = written - code_at;
			code_at = written++;
		}
	}
	frame[code_at] = written - code_at;
	frame[written++] = 0;
	return written;
}
