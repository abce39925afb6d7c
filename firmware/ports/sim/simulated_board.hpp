// SPDX-License-Identifier: GPL-3.0-or-later
// A whole R4 board in a process: the firmware on a model of the board, reached by any carriers. The
// board's timer sleeps until the application needs time. Then each passed millisecond is run.
//
// If the guard prevents feeding for watchdog_ms, a hardware watchdog resets the microcontroller,
// not the chips. The loop checks in even on a slow machine; only a script's `hang` prevents the
// check-in. Used from the thread of its io_context only. A datagram allocates no heap memory.
#pragma once

#include <array>
#include <asio/io_context.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "../../application/application.hpp"
#include "carrier_port.hpp"
#include "devices/optional_devices.hpp"
#include "r4link/config.hpp"
#include "robot/board_model.hpp"
#include "script.hpp"
#include "simulated_hardware.hpp"

namespace r4::sim {

class SimulatedBoard final : private firmware::Observer, private CarrierPort::Owner {
 public:
  // Each function may be empty, and must not stop the board. `t_ms`: the board's clock, as in T.
  struct Events {
    std::function<void(std::uint32_t t_ms, firmware::BoardState, SafeReason)> on_state;
    std::function<void(std::uint32_t t_ms, const Pins&)> on_pins;
    std::function<void(std::uint32_t t_ms, const ScriptStep&)> on_step;  // script or happen()
    std::function<void()> on_millisecond;  // after each millisecond of the board
    std::function<void(std::uint32_t t_ms, ChipFault)> on_fault;
    std::function<void(std::uint32_t t_ms, std::uint32_t pnum, const Command&)> on_executed;
    std::function<void(std::uint32_t t_ms, std::uint32_t pnum, Refusal)> on_refused;
    std::function<void(std::uint32_t t_ms, Verdict)> on_rejected;
    std::function<void(std::uint32_t t_ms, const Carrier&, bool joined)> on_path;
    std::function<void(std::uint32_t t_ms, const Carrier&, const CarrierEvent&)> on_carrier;
  };

  struct Options {
    // Makes clock, analog inputs and nonces predictable: for tests. Without a seed they are random.
    std::optional<std::uint64_t> seed;
    std::string board_id = "sim-1";  // texts of its answer to Q:ID
    std::string firmware_version = R4LINK_VERSION;
    std::string capabilities = "sim";
    Script script;
    Settings settings;
    Wiring wired = plan_wiring();  // how the board is wired, independent of its settings
    bool plan_confirmed = true;    // false: no wiring in its settings, as in a new board
    Events events;
    // A clock in ms, for tests. With a clock the board has no timer: the caller calls poll().
    std::function<std::uint32_t()> clock_ms;
  };

  SimulatedBoard(asio::io_context& io, Options options);
  ~SimulatedBoard();

  // Call before start(). Throws Error{usage} beyond Application::max_ports.
  void add_carrier(std::unique_ptr<Carrier> carrier);

  // Opens the carriers, and throws Error if that fails. Switches the board on.
  void start();
  // Switches the outputs off and closes the carriers.
  void stop() noexcept;

  // Does everything that is due; returns the milliseconds until the next call.
  std::uint32_t poll();

  // Carries out a step now, as in the script. Call between start() and stop(), not in an event.
  void happen(const ScriptStep& step);

  BoardModel& model() { return model_; }
  const BoardModel& model() const { return model_; }
  // The running firmware; only between start() and stop().
  const firmware::Application& application() const { return *application_; }
  std::uint32_t now_ms() const { return board_ms(elapsed()); }

  static constexpr std::chrono::milliseconds watchdog_ms{500};

 private:
  using Clock = std::chrono::steady_clock;
  using Milliseconds = std::chrono::milliseconds;

  Milliseconds elapsed() const;
  std::uint32_t board_ms(Milliseconds elapsed) const {
    return static_cast<std::uint32_t>(elapsed.count()) + clock_offset_ms_;
  }
  void reset_microcontroller();
  std::array<std::uint8_t, Authentication::chance_size> chance() const;
  void boot(SafeReason cause = SafeReason::none);
  void advance(Milliseconds elapsed);
  void pass_millisecond();
  void take(const ScriptStep& step);
  void tell_pins();
  bool hangs() const { return passed_ < hangs_until_; }
  std::uint32_t poll(Milliseconds elapsed);
  void settle_downs(std::uint32_t t_ms);
  void arm(Milliseconds at);

  void on_datagram(CarrierPort& port, Peer from, std::string_view bytes) override;
  void on_drained(CarrierPort& port) override;
  void on_carrier_event(CarrierPort& port, const CarrierEvent& event) override;

  void on_state(std::uint32_t t_ms, firmware::BoardState state, SafeReason reason) override;
  void on_outputs(std::uint32_t t_ms, const firmware::Outputs& outputs) override;
  void on_executed(std::uint32_t t_ms, std::uint32_t pnum, const Command& command) override;
  void on_refused(std::uint32_t t_ms, std::uint32_t pnum, Refusal code) override;
  void on_rejected(std::uint32_t t_ms, Verdict verdict) override;
  void on_path(std::uint32_t t_ms, Source path, bool joined) override;

  Options options_;
  std::uint64_t seed_;
  BoardModel model_;
  OptionalDevices optional_devices_{model_.devices().bus};
  std::optional<SimulatedHardware> hardware_;
  std::vector<std::unique_ptr<CarrierPort>> ports_;
  std::optional<firmware::Application> application_;

  std::uint32_t clock_offset_ms_ = 0;  // different at each boot, so that no T repeats
  std::uint32_t boots_ = 0;
  Clock::time_point start_;
  std::uint32_t clock_start_ms_ = 0;  // options_.clock_ms at start()
  Milliseconds passed_{};             // time passed on the board since start()
  Milliseconds hangs_until_{};        // end of the loop's hang
  Milliseconds watchdog_fed_{};
  std::optional<Pins> told_pins_;
  bool told_fault_ = false;
  std::size_t next_step_ = 0;
  bool in_application_ = false;  // a carrier may report its end inside a send
  std::uint32_t downs_ = 0;      // bit n: port n went down inside a send

  asio::steady_timer timer_;
  bool armed_ = false;
  Milliseconds armed_for_{};
  std::shared_ptr<const bool> alive_;  // timer handlers may run after stop()
};

}  // namespace r4::sim
