/* The numbers of PROTOCOL.md, which is their source; a test compares this file with its tables. */
#pragma once

/* Constants */
#define VERSION 3
#define OLDEST_VERSION 2
#define BAUD 500000UL
#define JOINTS 2
#define MUSCLES 4
#define EXTRAS 2
#define DEAD_MAN_MS 250
#define OVER_PRESSURE_SAMPLES 3
#define WATCHDOG_MS 120
#define VELOCITY_SCALE 64
#define MOST_VELOCITY_MS 32
#define LONGEST_FRAME 64
#define PULSE_UNIT_US 8
#define LONGEST_PULSE 31250
#define HOLD 0xffff

/* Requests and the lengths of their payloads */
#define CONNECT 0x01
#define CONFIGURE 0x02
#define ARM 0x03
#define DISARM 0x04
#define EXCHANGE 0x05
#define READ 0x06
#define PULSE 0x07

#define CONNECT_LENGTH 5
#define CONFIGURE_LENGTH 10
#define ARM_LENGTH 4
#define DISARM_LENGTH 0
#define EXCHANGE_LENGTH 2
#define READ_LENGTH 0
#define PULSE_LENGTH 12

/* Replies and the lengths of their payloads */
#define HELLO 0x81
#define STATUS 0x82
#define READING 0x85
#define REFUSED 0xff

#define HELLO_LENGTH 12
#define STATUS_LENGTH 7
#define READING_LENGTH 27
#define REFUSED_LENGTH 4

/* Valve codes: two bits a muscle, muscle 1 of joint 1 lowest */
#define CLOSED 0
#define IN 1
#define OUT 2

/* Flags */
#define ARMED 0x0001
#define CONFIGURED 0x0002
#define REPEATED 0x0004
#define DEAD_MAN 0x0008
#define CONVERTER 0x0010
#define STALE_SEEN 0x0020
#define CORRUPT_SEEN 0x0040
#define OVERRUN_SEEN 0x0080
#define OVER_PRESSURE_1 0x0100
#define OVER_PRESSURE_2 0x0200
#define OVER_PRESSURE_3 0x0400
#define OVER_PRESSURE_4 0x0800

/* Reasons of refusal */
#define NOT_CONNECTED 1
#define WRONG_VERSION 2
#define WRONG_SESSION 3
#define NOT_CONFIGURED 4
#define NOT_ARMED 5
#define STILL_ARMED 6
#define CAUSE_REMAINS 7
#define BAD_VALUE 8

/* Reset causes: the bits of the microcontroller's own register MCUSR */
#define POWER_ON 1
#define EXTERNAL 2
#define BROWN_OUT 4
#define WATCHDOG 8
