// SPDX-License-Identifier: GPL-3.0-or-later
#include "can_processes.hpp"

#include <sched.h>
#include <sys/mman.h>

#include <array>
#include <asio/io_context.hpp>
#include <asio/posix/stream_descriptor.hpp>
#include <asio/post.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <new>

#include "firmware/ports/sim/simulated_board.hpp"
#include "protocol/units.hpp"
#include "transports/framing/can_ids.hpp"
#include "transports/registry.hpp"

namespace r4::bench {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr std::uint32_t unused_id = 0x7FF;
constexpr char pass_time = 'p', hold_time = 'h', tell_sent = 's';

std::string url_of(std::uint8_t node) {
  return std::string("can://") + test::can_interface + "?node=" + std::to_string(node);
}

// A carrier's handler that takes nothing.
struct Deaf : Carrier::Handler {
  void on_datagram(std::string_view, Peer) override {}
  void on_carrier_event(const CarrierEvent&) override {}
};

}  // namespace

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

CanBoardProcess::CanBoardProcess() {
  if (fork_child()) serve();
  char ready = 0;
  read_all(control_, &ready, 1);
}

std::string CanBoardProcess::url() { return url_of(our_node); }

void CanBoardProcess::let_time_pass(bool wanted) const {
  write_all(control_, wanted ? &pass_time : &hold_time, 1);
}

std::size_t CanBoardProcess::mean_size() {
  write_all(control_, &tell_sent, 1);
  Sent now;
  read_all(control_, &now, sizeof now);
  const std::uint64_t datagrams = now.datagrams - before_.datagrams;
  const std::uint64_t bytes = now.bytes - before_.bytes;
  before_ = now;
  return datagrams == 0 ? 0 : static_cast<std::size_t>(bytes / datagrams);
}

void CanBoardProcess::serve() const {
  asio::io_context io{ASIO_CONCURRENCY_HINT_UNSAFE};
  std::uint32_t clock_ms = 0;
  bool time_passes = true;
  sim::SimulatedBoard* running = nullptr;

  sim::SimulatedBoard::Options options;
  options.settings.timeout_ms = 10000;  // of a clock that runs too fast at times
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
  auto carrier = Registry::standard().make(io, url(), Role::board);
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
            const Sent sent{end.counters().tx_datagrams, end.counters().tx_bytes};
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

// --- the plain program

KernelEchoProcess::KernelEchoProcess(std::size_t answer_size) {
  if (!fork_child()) {
    char ready = 0;
    read_all(control_, &ready, 1);
    return;
  }
  test::KernelIsotp dialogue = kernel_dialogue(true);
  test::KernelIsotp telemetry = kernel_telemetry(true);
  write_all(control_, "r", 1);
  const std::string answer(answer_size, 'a');
  std::array<char, max_datagram> question;
  for (;;) {
    dialogue.await_datagram(question.data(), question.size());
    telemetry.send(answer);
  }
}

// --- senders

CanSenderProcess::CanSenderProcess(CanStack stack, Lane lane, std::size_t datagram_size) {
  void* const memory =
      ::mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  require(memory != MAP_FAILED, "mmap");
  shared_ = new (memory) Shared;
  if (fork_child()) serve(stack, lane, std::string(datagram_size, 'x'));
  char ready = 0;
  read_all(control_, &ready, 1);
}

CanSenderProcess::~CanSenderProcess() { ::munmap(shared_, sizeof(Shared)); }

void CanSenderProcess::begin(std::uint32_t count) const {
  shared_->received = 0;
  write_all(control_, &count, sizeof count);
}

std::uint32_t CanSenderProcess::next_count() {
  std::uint32_t count = 0;
  read_all(control_, &count, sizeof count);
  return count;
}

void CanSenderProcess::await_room(std::uint32_t sent) const {
  while (sent - shared_->received.load(std::memory_order_acquire) >= ahead) ::sched_yield();
}

void CanSenderProcess::serve(CanStack stack, Lane lane, const std::string& datagram) {
  if (stack == CanStack::ours) {
    serve_ours(lane, datagram);
  } else {
    serve_kernel(lane, datagram);
  }
  end_child();
}

void CanSenderProcess::serve_ours(Lane lane, const std::string& datagram) {
  asio::io_context io{ASIO_CONCURRENCY_HINT_UNSAFE};
  const auto carrier = Registry::standard().make(
      io, url_of(our_node), lane == Lane::telemetry ? Role::board : Role::host);
  Deaf handler;
  carrier->open(handler);
  write_all(control_, "r", 1);
  for (;;) {
    const std::uint32_t count = next_count();
    for (std::uint32_t sent = 0; sent < count;) {
      if (lane == Lane::telemetry) await_room(sent);
      if (carrier->send(datagram, Priority::normal) == SendResult::sent) {
        ++sent;
      } else {
        io.run_one_for(1s);
      }
    }
    while (carrier->counters().tx_datagrams % count != 0) io.run_one_for(1s);
    for (int i = 0; i < 3; ++i) io.run_one_for(1ms);  // the last transfer
  }
}

void CanSenderProcess::serve_kernel(Lane lane, const std::string& datagram) {
  test::KernelIsotp socket =
      lane == Lane::telemetry ? kernel_telemetry(true) : kernel_dialogue(false);
  write_all(control_, "r", 1);
  for (;;) {
    const std::uint32_t count = next_count();
    for (std::uint32_t sent = 0; sent < count; ++sent) {
      if (lane == Lane::telemetry) await_room(sent);
      socket.send(datagram);
    }
  }
}

}  // namespace r4::bench
