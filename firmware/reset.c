#include "reset.h"

#include <avr/eeprom.h>
#include <avr/io.h>
#include <avr/wdt.h>

#include "protocol.h"

_Static_assert(POWER_ON == _BV(PORF) && EXTERNAL == _BV(EXTRF) && BROWN_OUT == _BV(BORF) && WATCHDOG == _BV(WDRF),
	"the causes are the bits of MCUSR");

static uint8_t cause __attribute__((section(".noinit")));
static uint16_t boots;
static uint16_t EEMEM stored;

/* Before anything else: after its reset the watchdog runs on at 16 ms, until its flag is cleared. */
static void first(void) __attribute__((naked, used, section(".init3")));
static void first(void)
{
	cause = MCUSR;
	MCUSR = 0;
	wdt_enable(WDTO_120MS);
}

uint8_t reset_cause(void)
{
	return cause & (POWER_ON | EXTERNAL | BROWN_OUT | WATCHDOG);
}

void reset_count(void)
{
	/* Inverted, so that an erased EEPROM, all ones, reads 0. */
	boots = ~eeprom_read_word(&stored) + 1;
	eeprom_update_word(&stored, ~boots);
}

uint16_t reset_boots(void)
{
	return boots;
}
