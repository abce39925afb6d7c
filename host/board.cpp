// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/board.hpp"

#include <fmt/format.h>

#include <utility>
#include <variant>

#include "board_impl.hpp"
#include "commands/limits.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/tables/settings.hpp"
#include "r4link/wiring/wiring_file.hpp"
#include "r4link/wiring/wiring_value.hpp"
#include "standard_registry.hpp"

namespace r4 {

Board::Board(std::string_view url, BoardOptions options, BoardCallbacks callbacks)
    : Board(std::vector<std::string>{std::string(url)}, std::move(options), std::move(callbacks)) {}
Board::Board(const std::vector<std::string>& urls, BoardOptions options, BoardCallbacks callbacks)
    : impl_(Impl::started(
          [&urls, role = options.role](Loop& loop) {
            return make_host_carriers(context_of(loop), urls, role);
          },
          std::move(options), std::move(callbacks))) {}
Board::Board(const CarrierMaker& make, BoardOptions options, BoardCallbacks callbacks)
    : Board(std::vector<CarrierMaker>{make}, std::move(options), std::move(callbacks)) {}
Board::Board(const std::vector<CarrierMaker>& makers, BoardOptions options,
             BoardCallbacks callbacks)
    : impl_(Impl::started(
          [&makers](Loop& loop) {
            std::vector<std::unique_ptr<Carrier>> carriers;
            carriers.reserve(makers.size());
            for (const CarrierMaker& make : makers) carriers.push_back(make(loop));
            return carriers;
          },
          std::move(options), std::move(callbacks))) {}
Board::~Board() { impl_->close(); }

void Board::close() { impl_->close(); }

BoardRole Board::role() const { return impl_->async.role(); }
void Board::take_control() {
  const auto impl = impl_;
  const bool here =
      impl->run_on_loop("take_control()", [impl = impl.get()] { impl->async.take_control(); });
  if (!here) throw impl->closed_error("take_control()");
}
void Board::release_control(Duration timeout) {
  require_timeout("release_control()", timeout);
  const auto impl = impl_;
  const std::string text = "release_control()";
  const auto release = [](AsyncBoard& board, std::size_t, Duration left, auto end) {
    board.async_release_control(left, std::move(end));
  };
  const auto part = impl->run(text, release, timeout);
  const Outcome outcome = part->result.outcome;
  const bool was_ours = outcome != Outcome::none && outcome != Outcome::refused;
  if (!was_ours || outcome == Outcome::confirmed) return;
  throw Error(explain(text, part->result, part->link));
}

bool Board::post_to_loop(std::function<void(AsyncBoard&)> action) {
  return impl_->post_to_loop(
      [impl = impl_.get(), action = std::move(action)] { action(impl->async); });
}

// Each waiting call owns the Impl, so that the Board may be destroyed meanwhile.

void Board::wait_active(Duration timeout) {
  require_wait("wait_active()", timeout);
  const auto impl = impl_;
  const bool active = impl->wait_for_news(timeout, [&] {
    return impl->link.cannot_begin() || is_ready(impl->async.role(), impl->link);
  });
  const LinkStatus link = impl->read(impl->link);
  if (link.cannot_begin()) throw Error(explain(paths()));
  if (!active) throw Error(explain(impl->read(impl->name), link));
}

void Board::send(const Command& command, Duration timeout) {
  const auto impl = impl_;
  // A stop is sent even without a timeout.
  if (command.kind == CommandKind::stop && timeout.count() <= 0) post(command);
  impl->execute(OwnCommand(command), timeout);
}
void Board::send(const Setpoints& setpoints, Duration timeout) {
  const auto impl = impl_;
  impl->execute(setpoints, timeout);
}
void Board::send(std::string_view text, Duration timeout) {
  std::visit([&](const auto& each) { send(each, timeout); }, parse_text(text));
}
PostResult Board::post(const Command& command) { return impl_->post(OwnCommand(command)); }
PostResult Board::post(const Setpoints& setpoints) { return impl_->post(setpoints); }
void Board::arm(Duration timeout) {
  require_timeout("arm()", timeout);
  require_control(role(), "arm()");
  const auto impl = impl_;
  const auto arm = [](AsyncBoard& board, std::size_t, Duration left, auto end) {
    board.async_arm(left, std::move(end));
  };
  confirmed("arm()", impl->run("arm()", arm, timeout));
}
DisarmCause Board::disarmed_by() const { return impl_->read(impl_->disarmed_by); }

void Board::stop(Duration timeout) { send(Command::stop(), timeout); }
void Board::stop_async() { post(Command::stop()); }

Command Board::DriveChannel::command(Pwm pwm, Direction direction) const {
  return kind_ == CommandKind::osmc ? Command::osmc(channel_, pwm, direction)
                                    : Command::dhb12(channel_, pwm, direction);
}
Command Board::DriveChannel::command(double duty) const {
  const Duty checked = checked_duty(duty);
  return command(checked.pwm(), checked.direction());
}
void Board::DriveChannel::set(double duty, Duration timeout) const {
  board_.send(command(duty), timeout);
}
PostResult Board::DriveChannel::post(double duty) const { return board_.post(command(duty)); }
void Board::DriveChannel::set_pwm(int pwm, Direction direction, Duration timeout) const {
  board_.send(command(Pwm(pwm), direction), timeout);
}
PostResult Board::DriveChannel::post_pwm(int pwm, Direction direction) const {
  return board_.post(command(Pwm(pwm), direction));
}
void Board::ServoChannel::set(Microseconds pulse, Duration timeout) const {
  board_.send(Command::servo(channel_, pulse), timeout);
}
PostResult Board::ServoChannel::post(Microseconds pulse) const {
  return board_.post(Command::servo(channel_, pulse));
}
static std::size_t servo_index(int channel) {
  if (channel >= 1 && channel <= servo_channels) return static_cast<std::size_t>(channel - 1);
  throw Error(ErrorKind::usage, fmt::format("servo({})", channel), "the channel is out of range",
              fmt::format("give 1 to {}", servo_channels));
}
void Board::ServoChannel::calibrate(const ServoCalibration& calibration) const {
  const std::size_t index = servo_index(channel_);
  const std::lock_guard lock(board_.impl_->mutex);
  board_.impl_->servo_calibrations[index] = calibration;
}
ServoCalibration Board::ServoChannel::calibration() const {
  const auto known = board_.impl_->read(board_.impl_->servo_calibrations[servo_index(channel_)]);
  if (known) return *known;
  throw Error(ErrorKind::usage, fmt::format("servo({})", channel_), "the servo is not calibrated",
              "call calibrate() first, with the pulse and the angle at each end of the servo's "
              "travel; or set a pulse in microseconds");
}
void Board::ServoChannel::set(Degrees angle, Duration timeout) const {
  set(calibration().pulse(angle), timeout);
}
PostResult Board::ServoChannel::post(Degrees angle) const {
  return post(calibration().pulse(angle));
}
void Board::RelayChannel::set(bool on, Duration timeout) const {
  board_.send(Command::relay(channel_, on), timeout);
}
PostResult Board::RelayChannel::post(bool on) const {
  return board_.post(Command::relay(channel_, on));
}
void Board::StepperChannel::move_to(Steps position, StepsPerSecond speed, Duration timeout) const {
  board_.send(Command::stepper(channel_, position, speed), timeout);
}
PostResult Board::StepperChannel::post(Steps position, StepsPerSecond speed) const {
  return board_.post(Command::stepper(channel_, position, speed));
}
void Board::StepperChannel::zero(Duration timeout) const {
  board_.send(Command::zero(channel_), timeout);
}
void Board::BldcChannel::set(double duty, bool brake, Duration timeout) const {
  board_.send(Command::bldc(channel_, checked_duty(duty), brake), timeout);
}
PostResult Board::BldcChannel::post(double duty, bool brake) const {
  return board_.post(Command::bldc(channel_, checked_duty(duty), brake));
}
void Board::BldcChannel::set_pwm(int speed, Direction direction, bool brake,
                                 Duration timeout) const {
  board_.send(Command::bldc(channel_, Pwm(speed), direction, brake), timeout);
}
PostResult Board::BldcChannel::post_pwm(int speed, Direction direction, bool brake) const {
  return board_.post(Command::bldc(channel_, Pwm(speed), direction, brake));
}
void Board::proximity(Channel channel, Centimetres threshold, Duration timeout) {
  send(Command::proximity(channel, threshold), timeout);
}
void Board::fields(std::string_view names, Duration timeout) {
  send("F:" + std::string(names), timeout);
}
void Board::setting(std::string_view key, std::string_view value, Duration timeout) {
  send("C:" + std::string(key) + "," + std::string(value), timeout);
}

void Board::link_timing(Duration board_timeout, Duration heartbeat, Duration timeout) {
  const std::string text = "C:timeout," + std::to_string(board_timeout.count()) + " C:heartbeat," +
                           std::to_string(heartbeat.count());
  require_timeout(text, timeout);
  require_control(role(), text);
  const auto impl = impl_;
  impl->async.require_link_timing(board_timeout, heartbeat);
  const auto set = [=](AsyncBoard& board, std::size_t, Duration left, auto end) {
    board.async_link_timing(board_timeout, heartbeat, left, std::move(end));
  };
  confirmed(text, impl->run(text, set, timeout));
}

BoardIdentity Board::identify(Duration timeout) {
  const auto impl = impl_;
  impl->execute(OwnCommand(Command::identify()), timeout);
  return impl->read(impl->identity);
}

BoardWiring Board::wiring(Duration timeout) {
  const auto impl = impl_;
  impl->execute(OwnCommand(Command::ask_wiring()), timeout);
  return impl->read(impl->identity).wiring.value();
}

void Board::give_wiring(const Wiring& wiring, Duration timeout) {
  const WiringCheck found = check(wiring);
  if (found.fault != WiringFault::none) throw Error(problem_of(wiring, found));
  char value[max_wiring_value];
  const Text text = write_wiring_value(wiring, value);
  const Text key = row_of(Setting::wiring).key;
  setting({key.data(), key.size()}, {text.data(), text.size()}, timeout);
}

ReceivedState Board::state() const { return impl_->read(impl_->state); }
ReceivedState Board::next_state(Duration timeout) {
  require_timeout("next_state()", timeout);
  const auto impl = impl_;
  const std::uint64_t seen = impl->read(impl->states);
  if (!impl->wait_for_news(timeout, [&] { return impl->states != seen; })) {
    Problem problem = explain(impl->read(impl->name), impl->read(impl->link));
    problem.reason = "a state did not arrive in time: " + problem.reason;
    throw Error(std::move(problem));
  }
  return impl->read(impl->state);
}
States Board::states(StatesOptions options) {
  const auto queue = std::make_shared<States::Queue>(options, impl_->on_wait);
  const std::lock_guard lock(impl_->mutex);
  if (impl_->closed) {
    queue->end();
  } else {
    impl_->queues.push_back(queue);
  }
  return States(queue);
}
std::optional<ReceivedState> States::take(Duration timeout) { return queue_->take(timeout); }
bool States::ended() const { return queue_->ended(); }
std::uint64_t States::missed() const { return queue_->missed(); }
LinkStatus Board::link() const { return impl_->read(impl_->link); }
std::string Board::name() const { return impl_->read(impl_->name); }

Statistics Board::statistics() const {
  const auto impl = impl_;
  Statistics report =
      impl->report("statistics()", impl->last_statistics, [&] { return impl->async.statistics(); });
  report.refused += impl->read(impl->refused_here);
  return report;
}
CarrierCounters Board::carrier_counters() const {
  const auto impl = impl_;
  return impl->report("carrier_counters()", impl->last_counters,
                      [&] { return impl->async.carrier_counters(); });
}
std::vector<PathStatus> Board::paths() const {
  const auto impl = impl_;
  return impl->report("paths()", impl->last_paths, [&] { return impl->async.paths(); });
}

void Board::record(const std::string& path, RecordingOptions options) {
  const auto impl = impl_;
  auto own = std::make_unique<Recording>(path, options);
  impl->run_on_loop("record()", [&] { impl->async.record(*own); });
  impl->keep(std::move(own));
}
void Board::record(Recording& recording) {
  const auto impl = impl_;
  impl->run_on_loop("record()", [&] { impl->async.record(recording); });
  impl->keep(nullptr);
}

Subscription Board::on_state(std::function<void(const ReceivedState&)> callback) {
  return impl_->callbacks.add<ReceivedState>(std::move(callback));
}
Subscription Board::on_link(std::function<void(const LinkStatus&)> callback) {
  return impl_->callbacks.add<LinkStatus>(std::move(callback));
}
Subscription Board::on_event(std::function<void(const CarrierEvent&)> callback) {
  return impl_->callbacks.add<CarrierEvent>(std::move(callback));
}
Subscription Board::on_path(std::function<void(const PathStatus&)> callback) {
  return impl_->callbacks.add<PathStatus>(std::move(callback));
}
Subscription Board::on_restart(std::function<void()> callback) {
  return impl_->callbacks.add_restart(std::move(callback));
}
Subscription Board::on_arming(std::function<void(DisarmCause)> callback) {
  return impl_->callbacks.add<DisarmCause>(std::move(callback));
}
Subscription Board::on_refused(std::function<void(const RefusedPost&)> callback) {
  return impl_->callbacks.add<RefusedPost>(std::move(callback));
}

void Board::watchdog(Duration period) {
  require_watchdog(period);
  const auto impl = impl_;
  impl->run_on_loop("watchdog()", [impl = impl.get(), period] { impl->async.watchdog(period); });
}
void Board::feed() { impl_->async.feed(); }

}  // namespace r4
