// SPDX-License-Identifier: GPL-3.0-or-later
#include "can_processes.hpp"

#include <sched.h>

#include <array>
#include <asio/io_context.hpp>
#include <asio/posix/stream_descriptor.hpp>
#include <asio/post.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <cstring>
#include <functional>
#include <memory>

#include "firmware/ports/sim/simulated_board.hpp"
#include "r4link/can/can_ids.hpp"
#include "r4link/vocabulary.hpp"
#include "transports/board_end.hpp"
#include "transports/registry.hpp"

namespace r4::bench {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr std::uint32_t unused_id = 0x7FF;
constexpr char pass_time = 'p', hold_time = 'h', tell_sent = 's';

struct Deaf : Carrier::Handler {
  void on_datagram(std::string_view, Peer) override {}
  void on_carrier_event(const CarrierEvent&) override {}
};

}  // namespace

const char* to_text(Form form) { return form == Form::plain ? "plain" : "packed"; }

std::string board_url(Form form, Above above) {
  const int node = (form == Form::plain ? 5 : 7) + (above == Above::nothing ? 4 : 0);
  return std::string("can://") + test::can_interface + "?node=" + std::to_string(node);
}

std::string host_url(Form form, Above above) {
  return board_url(form, above) + (form == Form::plain ? "&pack=0" : "");
}

test::KernelIsotp kernel_dialogue(bool board) {
  const std::uint32_t command = command_id(kernel_node);
  const std::uint32_t reply = reply_id(kernel_node);
  return board ? test::KernelIsotp(command, reply, {}) : test::KernelIsotp(reply, command, {});
}

test::KernelIsotp kernel_telemetry(bool board) {
  test::KernelIsotpOptions options;
  options.flags = board ? CAN_ISOTP_CF_BROADCAST : CAN_ISOTP_LISTEN_MODE;
  const std::uint32_t id = telemetry_id(kernel_node);
  return board ? test::KernelIsotp(unused_id, id, options)
               : test::KernelIsotp(id, unused_id, options);
}

// --- a board of ours

CanBoardProcess::CanBoardProcess(Form form) {
  if (fork_child()) serve(form);
  char ready = 0;
  read_all(control_, &ready, 1);
}

void CanBoardProcess::let_time_pass(bool wanted) const {
  write_all(control_, wanted ? &pass_time : &hold_time, 1);
}

CanBoardProcess::Passed CanBoardProcess::sent() const {
  write_all(control_, &tell_sent, 1);
  Passed now;
  read_all(control_, &now, sizeof now);
  return now;
}

void CanBoardProcess::serve(Form form) const {
  asio::io_context io{ASIO_CONCURRENCY_HINT_UNSAFE};
  std::uint32_t clock_ms = 0;
  bool time_passes = true;
  sim::SimulatedBoard* running = nullptr;

  sim::SimulatedBoard::Options options;
  options.settings.timeout_ms = 10000;  // the clock runs too fast at times
  // With a high rate, the clock advances less time per trip.
  options.settings.state_rate_hz = 1000;
  options.settings.pack = form == Form::packed;
  options.clock_ms = [&] { return clock_ms; };
  const std::uint32_t period_ms = 1000 / options.settings.state_rate_hz;
  options.events.on_executed = [&](std::uint32_t, std::uint32_t, const Command&) {
    if (time_passes) return;
    asio::post(io, [&] {
      clock_ms += period_ms;
      running->poll();
    });
  };
  sim::SimulatedBoard board(io, std::move(options));
  running = &board;
  auto carrier = Registry::standard().make(io, board_url(form), Role::board);
  const Carrier& end = *carrier;
  board.add_carrier(std::move(carrier));
  board.start();

  asio::steady_timer timer(io);
  std::function<void()> tick = [&] {
    timer.expires_after(1ms);
    timer.async_wait([&](const std::error_code& error) {
      if (error || !time_passes) return;
      ++clock_ms;
      board.poll();
      tick();
    });
  };
  tick();

  asio::posix::stream_descriptor control(io, control_);
  char order = 0;
  std::function<void()> listen = [&] {
    control.async_read_some(
        asio::buffer(&order, 1), [&](const std::error_code& error, std::size_t) {
          if (error) end_child();
          if (order == tell_sent) {
            const Passed sent{end.counters().tx_datagrams, end.counters().tx_bytes};
            write_all(control_, &sent, sizeof sent);
          } else if (time_passes != (order == pass_time)) {
            time_passes = order == pass_time;
            if (time_passes) tick();
          }
          listen();
        });
  };
  listen();
  write_all(control_, "r", 1);
  io.run();
  end_child();
}

// --- a carrier of ours

CarrierEchoProcess::CarrierEchoProcess(Form form, const std::string& state) {
  if (fork_child()) serve(form, state, control_);
  char ready = 0;
  read_all(control_, &ready, 1);
}

void CarrierEchoProcess::serve(Form form, const std::string& state, int ready) {
  struct Echo : Carrier::Handler {
    void on_datagram(std::string_view, Peer) override { carrier->send(*state, Priority::state); }
    void on_carrier_event(const CarrierEvent&) override {}
    Carrier* carrier = nullptr;
    const std::string* state = nullptr;
  } echo;
  asio::io_context io{ASIO_CONCURRENCY_HINT_UNSAFE};
  const auto carrier = Registry::standard().make(io, board_url(form, Above::nothing), Role::board);
  board_end_of(*carrier).use_packed_form(form == Form::packed);
  echo.carrier = carrier.get();
  echo.state = &state;
  carrier->open(echo);
  write_all(ready, "r", 1);
  io.run();
  end_child();
}

// --- the plain program

std::string KernelEchoProcess::question(std::size_t size, std::uint16_t answer_size) {
  std::string question(size, 'q');
  std::memcpy(question.data(), &answer_size, sizeof answer_size);
  return question;
}

KernelEchoProcess::KernelEchoProcess() {
  if (!fork_child()) {
    char ready = 0;
    read_all(control_, &ready, 1);
    return;
  }
  test::KernelIsotp dialogue = kernel_dialogue(true);
  test::KernelIsotp telemetry = kernel_telemetry(true);
  write_all(control_, "r", 1);
  std::string answer;
  std::uint16_t answer_size = 0;
  std::array<char, max_datagram> question;
  for (;;) {
    dialogue.await_datagram(question.data(), question.size());
    std::memcpy(&answer_size, question.data(), sizeof answer_size);
    answer.assign(answer_size, 'a');
    telemetry.send(answer);
  }
}

// --- senders

std::uint32_t next_count(int control) {
  std::uint32_t count = 0;
  read_all(control, &count, sizeof count);
  return count;
}

void await_room(const SharedCount& received, std::uint32_t sent) {
  while (sent - received.get() >= ahead) ::sched_yield();
}

CanSenderProcess::CanSenderProcess(std::optional<Form> ours, Lane lane,
                                   const std::string& datagram) {
  if (fork_child()) {
    if (ours) serve_ours(*ours, lane, datagram);
    serve_kernel(lane, datagram);
  }
  char ready = 0;
  read_all(control_, &ready, 1);
}

void CanSenderProcess::begin(std::uint32_t count) const {
  received_.set(0);
  write_all(control_, &count, sizeof count);
}

void CanSenderProcess::serve_ours(Form form, Lane lane, const std::string& datagram) {
  asio::io_context io{ASIO_CONCURRENCY_HINT_UNSAFE};
  const auto carrier =
      Registry::standard().make(io, lane == Lane::telemetry ? board_url(form) : host_url(form),
                                lane == Lane::telemetry ? Role::board : Role::host);
  board_end_of(*carrier).use_packed_form(form == Form::packed);
  Deaf handler;
  carrier->open(handler);
  write_all(control_, "r", 1);
  for (;;) {
    const std::uint32_t count = next_count(control_);
    std::uint32_t sent = 0, seen = 0;
    Clock::time_point since = Clock::now();
    for (;;) {
      const std::uint32_t received = received_.get();
      if (received >= count) break;
      if (received != seen) since = Clock::now();
      seen = received;
      // Repeat lost datagrams: an emulated processor may exceed the timeouts of ISO-TP.
      if (Clock::now() - since > 200ms) sent = received;
      const bool room = sent < count && sent - received < ahead;
      if (room && carrier->send(datagram, Priority::normal) == SendResult::sent) {
        ++sent;
      } else if (lane == Lane::telemetry) {
        if (io.poll() == 0) ::sched_yield();
      } else {
        io.run_one_for(1ms);
      }
    }
  }
}

void CanSenderProcess::serve_kernel(Lane lane, const std::string& datagram) {
  test::KernelIsotp socket =
      lane == Lane::telemetry ? kernel_telemetry(true) : kernel_dialogue(false);
  write_all(control_, "r", 1);
  for (;;) {
    const std::uint32_t count = next_count(control_);
    for (std::uint32_t sent = 0; sent < count; ++sent) {
      if (lane == Lane::telemetry) await_room(received_, sent);
      socket.send(datagram);
    }
  }
}

}  // namespace r4::bench
