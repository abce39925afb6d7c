// SPDX-License-Identifier: GPL-3.0-or-later
#include "bench.hpp"

#include <utility>

#include "r4link/error.hpp"
#include "r4link/wiring/wiring_value.hpp"
#include "tests/support/carriers.hpp"
#include "transports/board_end.hpp"

namespace r4::simulation {
namespace {

sim::SimulatedBoard::Options board_options(const Bench::Options& options,
                                           std::function<std::uint32_t()> clock_ms) {
  sim::SimulatedBoard::Options board;
  board.seed = 7;
  board.wired = options.wired;
  board.plan_confirmed = !options.new_board;
  if (options.knows_wiring) {
    board.settings.site.wiring = options.wired;
    board.settings.site.wiring_source = WiringSource::given;
  }
  board.clock_ms = std::move(clock_ms);
  return board;
}

}  // namespace

class Bench::Cable final : public test::IdleCarrier, public BoardEnd {
 public:
  explicit Cable(std::deque<std::string>& to_host) : to_host_(to_host) {}
  SendResult send(std::string_view bytes, Priority, Peer) override {
    to_host_.emplace_back(bytes);
    return SendResult::sent;
  }
  void deliver(std::string_view bytes) { handler_->on_datagram(bytes, 1); }
  bool is_own_cable() const override { return true; }
  bool reaches(Peer) const override { return true; }

 private:
  std::deque<std::string>& to_host_;
};

Bench::Bench(const Options& options)
    : board_(io_, board_options(options, [this] { return now_ms(); })),
      session_(*this, SessionOptions{}, BoardRole::control, 1, [this] { return random_.next(); }),
      papers_firmware_(options.papers_firmware) {
  auto cable = std::make_unique<Cable>(to_host_);
  cable_ = cable.get();
  board_.add_carrier(std::move(cable));
  board_.start();
  for (const std::string& words : options.broken) happen(words);
  session_.on_transport(0, true, now_);
}

void Bench::happen(const std::string& words) {
  board_.happen(sim::Script::parse_now(words, "test").value());
}

void Bench::pass(std::uint32_t ms) {
  while (ms-- != 0) pass_millisecond();
}

void Bench::pass_millisecond() {
  now_ += std::chrono::milliseconds(1);
  board_.poll();
  for (const std::string& bytes : std::exchange(to_board_, {})) {
    if (!link_cut) cable_->deliver(bytes);
  }
  for (const std::string& bytes : std::exchange(to_host_, {})) {
    if (!link_cut) session_.receive(0, bytes, now_);
  }
  session_.poll(now_);
  if (on_millisecond) on_millisecond();
}

CommandResult Bench::result_of(Ticket ticket) {
  while (!ended_ || ended_->first != ticket) pass_millisecond();
  return ended_->second;
}

void Bench::wait_heard() {
  for (int ms = 0; ms < 10'000; ++ms) {
    if (is_heard(session_.link().state)) return;
    pass_millisecond();
  }
  throw Error(explain("bench", session_.link()));
}

std::optional<ReceivedState> Bench::next_state(Duration timeout) {
  if (supervised_ && !silent_) session_.feed(now_);
  for (auto left = timeout.count(); states_.empty() && left > 0; --left) pass_millisecond();
  if (states_.empty()) return std::nullopt;
  const ReceivedState state = states_.front();
  states_.pop_front();
  return state;
}

void Bench::send(const Command& command, Duration timeout) {
  const CommandResult result = result_of(session_.send(command, timeout, now_));
  if (result.outcome != Outcome::confirmed) {
    throw Error(explain(command, result, session_.link()));
  }
}

void Bench::arm() {
  const CommandResult result = result_of(session_.arm(std::chrono::seconds(1), now_));
  if (result.outcome != Outcome::confirmed) throw Error(explain("arm()", result, session_.link()));
}

BoardIdentity Bench::identify() {
  if (papers_firmware_) throw Error(ErrorKind::refused, "Q:ID", "not confirmed");
  send(Command::identify(), patience);
  return identity_;
}

BoardWiring Bench::wiring() {
  send(Command::ask_wiring(), patience);
  return identity_.wiring.value();
}

void Bench::give_wiring(const Wiring& wiring) {
  char value[max_wiring_value];
  send(Command::setting(Text("wiring"), write_wiring_value(wiring, value)), patience);
}

std::vector<std::uint8_t> Bench::scan() {
  send(Command::i2c_scan(), patience);
  for (int ms = 0; ms < 2000; ++ms) {
    pass_millisecond();
    const I2cAnswer& answer = session_.state().i2c_answer;
    if (answer.pnum == 0) continue;
    if (answer.outcome == I2cOutcome::done) return {answer.data.begin(), answer.data.end()};
    Problem problem{ErrorKind::refused, "X:SCAN", to_text(answer.outcome), ""};
    problem.outcome = Outcome::refused;
    throw Error(std::move(problem));
  }
  throw Error(ErrorKind::refused, "X:SCAN", "no answer");
}

void Bench::supervise(bool supervised) {
  supervised_ = supervised;
  set_watchdog();
}
void Bench::be_silent(bool silent) {
  silent_ = silent;
  set_watchdog();
}
void Bench::set_watchdog() {
  session_.watchdog(Duration(silent_ ? 1 : supervised_ ? 500 : 0), now_);
}

Bench::Quality Bench::measure(std::size_t, Duration time) {
  const auto before = session_.statistics(now_).states;
  pass(static_cast<std::uint32_t>(time.count()));
  const auto states = static_cast<double>(session_.statistics(now_).states - before);
  return {states * 1000 / static_cast<double>(time.count()), 0, 1};
}

SendResult Bench::transmit(std::size_t, std::string_view datagram, Priority) {
  to_board_.emplace_back(datagram);
  return SendResult::sent;
}
void Bench::on_state(const ReceivedState& state, const Datagram&) { states_.push_back(state); }
void Bench::on_identity(const Identity& identity) {
  const auto text = [](Text from) { return std::string(from.data(), from.size()); };
  identity_ = {text(identity.firmware), text(identity.board_id), text(identity.capabilities),
               text(identity.name)};
  BoardWiring kept;
  if (read_board_wiring(identity.wiring, kept)) identity_.wiring = kept;
}
void Bench::on_result(Ticket ticket, const CommandResult& result) {
  ended_.emplace(ticket, result);
}

}  // namespace r4::simulation
