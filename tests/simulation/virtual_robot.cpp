// SPDX-License-Identifier: GPL-3.0-or-later
#include "virtual_robot.hpp"

#include <utility>

namespace r4::simulation {
namespace {

SessionOptions options_of(const std::string& fields) {
  SessionOptions options;
  options.fields = fields;
  return options;
}

}  // namespace

VirtualRobot::VirtualRobot(std::uint64_t seed, const Link& link, const std::string& fields,
                           sim::RobotModel* robot)
    : random_(seed),
      link_(link),
      boot_ms_(static_cast<std::uint32_t>(random_.next())),
      model_(seed),
      hardware_(model_),
      session_(*this, options_of(fields), BoardRole::control, 1,
               [this] { return random_.next(); }) {
  model_.connect(robot);
  model_.power_on();
  hardware_.power_up();
  firmware::Application::Config config;
  config.identity = Identity{Text("simulated"), Text("0"), Text("sim")};
  config.chance = chance_;
  application_ = std::make_unique<firmware::Application>(hardware_.hal(), config);
  application_->add_port(*this);
  application_->start(board_ms());
  session_.on_transport(0, true, now());
}

bool VirtualRobot::arm() {
  Ticket asked = 0;
  for (int ms = 0; ms < 10'000; ++ms) {
    pass_millisecond();
    if (asked == 0 && session_.in_control(now())) {
      asked = session_.arm(std::chrono::seconds(5), now());
    }
    if (session_.disarmed_by() == DisarmCause::none) return true;
  }
  return false;
}

void VirtualRobot::pass_millisecond() {
  now_us_ += 1000;
  hardware_.pass_millisecond();
  application_->guard().check_in(firmware::Application::loop_duty);
  application_->guard().tick(board_ms());
  for (std::size_t i = 0; i < packets_.size();) {
    if (packets_[i].at_us > now_us_) {
      ++i;
      continue;
    }
    const Packet packet = std::move(packets_[i]);
    packets_.erase(packets_.begin() + static_cast<std::ptrdiff_t>(i));
    if (packet.to_board) {
      application_->receive(0, 1, Text(packet.bytes), board_ms());
    } else if (host_lives) {
      session_.receive(0, packet.bytes, now());
    }
  }
  application_->poll(board_ms());
  if (host_lives) session_.poll(now());
}

void VirtualRobot::put(bool to_board, std::string_view bytes) {
  if (link_cut || random_.chance(link_.loss)) return;
  const std::uint64_t takes_us =
      link_.delay_us - link_.jitter_us + random_.below(2 * link_.jitter_us + 1);
  packets_.push_back({now_us_ + takes_us, to_board, std::string(bytes)});
}

void VirtualRobot::send(Text datagram, Priority priority, std::uint32_t) {
  if (states_stop && priority == Priority::state) return;
  put(false, {datagram.data(), datagram.size()});
}

SendResult VirtualRobot::transmit(std::size_t, std::string_view bytes, Priority) {
  put(true, bytes);
  return SendResult::sent;
}

void VirtualRobot::on_state(const ReceivedState& state, const Datagram&) {
  if (state_came) state_came(state);
}

}  // namespace r4::simulation
