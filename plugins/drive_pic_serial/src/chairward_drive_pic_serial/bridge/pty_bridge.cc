// A gpsim module that joins the simulated PIC's UART to a pty and publishes its pins, in real time.
//
//   g++ -std=c++17 -O2 -shared -fPIC -I/usr/include/gpsim $(pkg-config --cflags glib-2.0) pty_bridge.cc -o ... -lgpsim
//
// Pins RX, TX: the UART, bit by bit. Pins D0..D7: PORTD. What it is told comes by environment (bridge/__init__.py):
//   CHAIRWARD_BAUD                bits a second
//   CHAIRWARD_LINK                name that the pty gets
//   CHAIRWARD_PINS                file of chairward.shared_state with the ten values of PIN_NAMES
//   CHAIRWARD_LOG                 optional: one line for each byte that arrived and for each change of the pins
//   CHAIRWARD_STATE, _FAULT       addresses of two bytes of the firmware's RAM
// SIGUSR1 pulls the cable out (the pty goes), SIGUSR2 plugs it in again (a new one takes its name).

#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <deque>
#include <string>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include <glib.h>
#include "gpsim_time.h"
#include "ioports.h"
#include "modules.h"
#include "packages.h"
#include "processor.h"
#include "stimuli.h"
#include "trigger.h"

namespace {

constexpr int64_t NS_PER_CYCLE = 200;         // 20 MHz, four clocks an instruction
constexpr guint64 POLL_CYCLES = 1000;         // look at the pty every 200 us
constexpr int64_t BEHIND_NS = 50'000'000;     // farther behind real time: give the lost time up, do not race after it
constexpr double PWM_STEPS = 250.0;
constexpr unsigned CCPR1L = 0x15, CCPR2L = 0x1B;
constexpr int VALUES = 10;                    // of PIN_NAMES, in that order

int64_t now_ns() {
  timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec * 1'000'000'000LL + t.tv_nsec;
}

const char *told(const char *name, const char *otherwise = nullptr) {
  const char *value = getenv(name);
  if (!value && !otherwise) {
    fprintf(stderr, "pty bridge: %s is not set\n", name);
    exit(1);
  }
  return value ? value : otherwise;
}

volatile sig_atomic_t wanted_in = 1;          // the cable
void on_signal(int number) { wanted_in = number == SIGUSR2; }

class Bridge;

struct RxPin : public IOPIN {                 // what the PIC sends
  Bridge &bridge;
  RxPin(Bridge &b) : IOPIN("RX"), bridge(b) {}
  void setDrivenState(bool state) override;
};

struct TxPin : public IO_bi_directional {     // what the PIC receives
  TxPin() : IO_bi_directional("TX") {
    bDrivingState = true;
    update_direction(1, true);
  }
};

struct PortPin : public IOPIN {               // one bit of PORTD
  Bridge &bridge;
  PortPin(Bridge &b, const char *name) : IOPIN(name), bridge(b) {}
  void setDrivenState(bool state) override;
};

template <void (Bridge::*Method)()> struct At : public TriggerObject {
  Bridge &bridge;
  explicit At(Bridge &b) : bridge(b) {}
  void callback() override { (bridge.*Method)(); }
};

class Bridge : public Module {
 public:
  explicit Bridge(const char *name)
      : Module(name, "pty bridge"),
        bit_cycles(1e9 / NS_PER_CYCLE / atof(told("CHAIRWARD_BAUD"))),
        link(told("CHAIRWARD_LINK")),
        state_at(strtoul(told("CHAIRWARD_STATE"), nullptr, 0)),
        fault_at(strtoul(told("CHAIRWARD_FAULT"), nullptr, 0)) {
    map_pins(told("CHAIRWARD_PINS"));
    if (const char *path = getenv("CHAIRWARD_LOG")) log = fopen(path, "w");
    signal(SIGUSR1, on_signal);
    signal(SIGUSR2, on_signal);
    plug();
    get_cycles().set_break(get_cycles().get() + 1, &poll_at);
  }

  static Module *construct(const char *name) {
    auto *bridge = new Bridge(name);
    bridge->create_iopin_map();
    return bridge;
  }

  void create_iopin_map() {
    create_pkg(10);
    addSymbol(rx);
    assign_pin(1, rx);
    addSymbol(tx);
    assign_pin(2, tx);
    for (int bit = 0; bit < 8; bit++) {
      auto *pin = new PortPin(*this, ("D" + std::to_string(bit)).c_str());
      addSymbol(pin);
      assign_pin(3 + bit, pin);
    }
  }

  void pic_line_changed(bool state) {         // a falling edge on an idle line is a start bit
    if (state || receiving) return;
    receiving = true;
    rx_bit = 0;
    rx_byte = 0;
    rx_start = double(get_cycles().get());
    get_cycles().set_break(guint64(rx_start + 1.5 * bit_cycles), &rx_at);
  }

  void port_changed() {                       // published once the whole port has been written
    if (change_due) return;
    change_due = true;
    get_cycles().set_break(get_cycles().get() + 1, &change_at);
  }

 private:
  RxPin *rx = new RxPin(*this);
  TxPin *tx = new TxPin();
  double bit_cycles;
  std::string link;
  unsigned state_at, fault_at;
  FILE *log = nullptr;
  int master = -1, slave = -1;

  bool receiving = false, sending = false, change_due = false;
  int rx_bit = 0, tx_bit = 0;
  unsigned rx_byte = 0, tx_byte = 0;
  double rx_start = 0, tx_start = 0;
  std::deque<uint8_t> waiting;

  int64_t wall0 = 0;                          // real time at cycle0
  guint64 cycle0 = 0;
  char *shared = nullptr;
  double *values = nullptr;
  double before[VALUES] = {};
  uint64_t sequence = 0;

  void rx_sample();
  void tx_step();
  void poll();
  void change();
  At<&Bridge::rx_sample> rx_at{*this};
  At<&Bridge::tx_step> tx_at{*this};
  At<&Bridge::poll> poll_at{*this};
  At<&Bridge::change> change_at{*this};

  int64_t due_ns() { return wall0 + int64_t(get_cycles().get() - cycle0) * NS_PER_CYCLE; }

  void plug() {
    master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    char name[128];
    if (master < 0 || grantpt(master) || unlockpt(master) || ptsname_r(master, name, sizeof name)) {
      perror("pty bridge: no pty");
      exit(1);
    }
    slave = open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);  // kept open: the wire is there when no host is
    termios raw;
    tcgetattr(slave, &raw);
    cfmakeraw(&raw);
    tcsetattr(slave, TCSANOW, &raw);
    const std::string part = link + ".part";
    unlink(part.c_str());
    if (symlink(name, part.c_str()) || rename(part.c_str(), link.c_str())) {
      perror("pty bridge: no link");
      exit(1);
    }
  }

  void unplug() {
    unlink(link.c_str());
    close(slave);
    close(master);
    master = slave = -1;
    waiting.clear();
  }

  void map_pins(const char *path) {
    const int file = open(path, O_RDWR | O_CLOEXEC);
    struct stat about;
    if (file < 0 || fstat(file, &about)) {
      perror(path);
      exit(1);
    }
    void *map = mmap(nullptr, size_t(about.st_size), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    if (map == MAP_FAILED) {
      perror(path);
      exit(1);
    }
    shared = static_cast<char *>(map);
    uint32_t names;
    memcpy(&names, shared + 8, sizeof names);
    values = reinterpret_cast<double *>(shared + 12 + names);
  }

  void publish() {
    auto *cpu = get_active_cpu();
    if (!cpu) return;
    auto byte = [cpu](unsigned at) { return cpu->rma[at].get_value() & 0xFF; };
    unsigned port = 0;
    for (int bit = 0; bit < 8; bit++) port |= unsigned(get_pin(3 + bit)->getDrivenState()) << bit;
    const double duty_steer = byte(CCPR1L) / PWM_STEPS, duty_drive = byte(CCPR2L) / PWM_STEPS;
    const double fresh[VALUES] = {double(std::max(now_ns(), wall0 ? due_ns() : 0)),
                                  duty_drive, double(port >> 2 & 1), double(port >> 3 & 1),
                                  duty_steer, double(port >> 0 & 1), double(port >> 1 & 1),
                                  double(!(port & 0x80)), double(byte(state_at)), double(byte(fault_at))};
    auto *mark = reinterpret_cast<volatile uint64_t *>(shared);
    *mark = ++sequence;                       // odd: being written
    __sync_synchronize();
    memcpy(values, fresh, sizeof fresh);
    __sync_synchronize();
    *mark = ++sequence;
    if (log && memcmp(fresh + 1, before + 1, sizeof fresh - sizeof fresh[0])) {
      fprintf(log, "pins %llu", (unsigned long long)get_cycles().get());
      for (int i = 1; i < VALUES; i++) fprintf(log, " %g", fresh[i]);
      fputc('\n', log);
      fflush(log);
    }
    memcpy(before, fresh, sizeof fresh);
  }
};

void RxPin::setDrivenState(bool state) {
  const bool changed = state != bDrivenState;
  bDrivenState = state;
  if (changed) bridge.pic_line_changed(state);
}

void PortPin::setDrivenState(bool state) {
  const bool changed = state != bDrivenState;
  bDrivenState = state;
  if (changed) bridge.port_changed();
}

void Bridge::rx_sample() {                    // in the middle of each bit, then of the stop bit
  const bool state = rx->getDrivenState();
  if (rx_bit < 8) {
    rx_byte |= unsigned(state) << rx_bit++;
    get_cycles().set_break(guint64(rx_start + (1.5 + rx_bit) * bit_cycles), &rx_at);
    return;
  }
  receiving = false;
  const uint8_t byte = uint8_t(rx_byte);
  if (state && master >= 0 && write(master, &byte, 1) != 1 && errno != EAGAIN) perror("pty bridge: write");
}

void Bridge::tx_step() {                      // start bit, eight bits, stop bit; then the next byte, if there is one
  if (sending && ++tx_bit <= 9) {
    tx->putState(tx_bit == 9 || (tx_byte >> (tx_bit - 1) & 1));
    get_cycles().set_break(guint64(tx_start + (tx_bit + 1) * bit_cycles), &tx_at);
    return;
  }
  if (sending && log) fprintf(log, "byte %llu %u\n", (unsigned long long)get_cycles().get(), tx_byte);
  sending = !waiting.empty();
  if (!sending) return;
  tx_byte = waiting.front();
  waiting.pop_front();
  tx_bit = 0;
  tx_start = double(get_cycles().get());
  tx->putState(false);
  get_cycles().set_break(guint64(tx_start + bit_cycles), &tx_at);
}

void Bridge::poll() {
  const guint64 cycle = get_cycles().get();
  if (!wall0) {
    wall0 = now_ns();
    cycle0 = cycle;
  }
  const int64_t ahead = due_ns() - now_ns();
  if (ahead > 0) {
    const timespec until{due_ns() / 1'000'000'000LL, due_ns() % 1'000'000'000LL};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
  } else if (-ahead > BEHIND_NS) {
    wall0 -= ahead;
  }
  if (wanted_in != (master >= 0)) wanted_in ? plug() : unplug();
  uint8_t bytes[256];
  const ssize_t count = master >= 0 ? read(master, bytes, sizeof bytes) : 0;
  for (ssize_t i = 0; i < count; i++) waiting.push_back(bytes[i]);
  if (!sending) tx_step();
  publish();
  get_cycles().set_break(cycle + POLL_CYCLES, &poll_at);
}

void Bridge::change() {
  change_due = false;
  publish();
}

Module_Types types[] = {{{"pty_bridge", "pty_bridge"}, Bridge::construct}, {{nullptr, nullptr}, nullptr}};

}  // namespace

extern "C" Module_Types *get_mod_list() { return types; }
