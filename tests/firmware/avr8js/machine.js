// A board for tests on avr8js, a second machine for the same .hex: node machine.js FIRMWARE.hex
//
// One command a line on the standard input, an object with one of
//   run: cycle    run until then            write: [bytes]        put bytes on the line
//   count: [channel, count]                 reset: bits of MCUSR  reset for that cause
//   hang: true    let the main loop hang, with interrupts, or without (false)
// and for each a line on the standard output: the cycle, and what happened since: [cycle, "pins" | "sent" | "reset", value].
import avr8js from "avr8js";
import { readFileSync } from "node:fs";
import { createInterface } from "node:readline";

const FREQUENCY = 16e6;
const BYTE_CYCLES = 320;
const FLASH_BYTES = 0x8000, RAM_BYTES = 0x800, EEPROM_BYTES = 0x400;
const PORTB = 0x25, DDRB = 0x24, PORTD = 0x2b, DDRD = 0x2a, MCUSR = 0x54;
const POWER_ON = 1, WATCHDOG = 8;
const CLI = 0x94f8, ENDLESS = 0xcfff;

function loaded(path) {
  const flash = new Uint8Array(FLASH_BYTES).fill(0xff);
  for (const line of readFileSync(path, "ascii").split("\n")) {
    if (line.slice(7, 9) !== "00") continue; // data records only
    const length = parseInt(line.slice(1, 3), 16), address = parseInt(line.slice(3, 7), 16);
    for (let i = 0; i < length; i++) flash[address + i] = parseInt(line.slice(9 + 2 * i, 11 + 2 * i), 16);
  }
  return new Uint16Array(flash.buffer);
}

class Board {
  constructor(program) {
    this.program = program;
    this.eeprom = new avr8js.EEPROMMemoryBackend(EEPROM_BYTES);
    this.volts = new Array(8).fill(0);
    this.waiting = [];
    this.events = [];
    this.pins = 0;
    this.begin(POWER_ON, 0);
  }

  // Begin anew: all registers as after a reset, which avr8js leaves to whoever uses it.
  begin(cause, cycle) {
    const cpu = (this.cpu = new avr8js.CPU(this.program, RAM_BYTES));
    cpu.cycles = cycle;
    cpu.data[MCUSR] = cause;
    this.wantsReset = false;
    cpu.reset = () => (this.wantsReset = true); // the watchdog's
    const clock = new avr8js.AVRClock(cpu, FREQUENCY);
    this.parts = [
      new avr8js.AVRTimer(cpu, avr8js.timer0Config),
      new avr8js.AVRTimer(cpu, avr8js.timer1Config),
      new avr8js.AVREEPROM(cpu, this.eeprom, avr8js.eepromConfig),
      new avr8js.AVRWatchdog(cpu, avr8js.watchdogConfig, clock),
    ];
    for (const config of [avr8js.portBConfig, avr8js.portDConfig])
      new avr8js.AVRIOPort(cpu, config).addListener(() => this.lookAtPins());
    this.adc = new avr8js.AVRADC(cpu, avr8js.adcConfig);
    this.adc.channelValues = this.volts;
    this.usart = new avr8js.AVRUSART(cpu, avr8js.usart0Config, FREQUENCY);
    this.usart.onByteTransmit = (byte) => this.events.push([cpu.cycles + BYTE_CYCLES, "sent", byte]);
    this.lookAtPins();
  }

  reset(cause) {
    this.begin(cause, this.cpu.cycles);
    this.events.push([this.cpu.cycles, "reset", cause]);
  }

  lookAtPins() {
    const data = this.cpu.data;
    const pins = ((data[PORTD] & data[DDRD]) >> 4) | ((data[PORTB] & data[DDRB]) << 4);
    if (pins !== this.pins) this.events.push([this.cpu.cycles, "pins", (this.pins = pins)]);
  }

  run(cycle) {
    while (this.cpu.cycles < cycle) {
      if (this.waiting.length && !this.usart.rxBusy) {
        const byte = this.waiting.shift();
        this.usart.writeByte(byte);
      }
      avr8js.avrInstruction(this.cpu);
      this.cpu.tick();
      if (this.wantsReset) this.reset(WATCHDOG);
    }
  }

  hang(interrupts) {
    for (let at = 1; at < this.program.length; at++)
      if (this.program[at - 1] === CLI && this.program[at] === ENDLESS) {
        this.cpu.pc = interrupts ? at : at - 1;
        return;
      }
    throw new Error("the program has no endless loop");
  }
}

const board = new Board(loaded(process.argv[2]));
for await (const line of createInterface({ input: process.stdin })) {
  const command = JSON.parse(line);
  if ("run" in command) board.run(command.run);
  if ("write" in command) board.waiting.push(...command.write);
  if ("count" in command) board.volts[command.count[0]] = ((command.count[1] + 0.5) / 1024) * board.adc.avcc;
  if ("reset" in command) board.reset(command.reset);
  if ("hang" in command) board.hang(command.hang);
  console.log(JSON.stringify({ cycle: board.cpu.cycles, events: board.events.splice(0) }));
}
