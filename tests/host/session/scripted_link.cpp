// SPDX-License-Identifier: GPL-3.0-or-later
#include "scripted_link.hpp"

#include "protocol/datagram/numbers.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::test {

ScriptedLink::ScriptedLink(SessionOptions options, BoardRole role)
    : session(*this, std::move(options), role, 1, [n = 99ULL]() mutable { return ++n; }) {
  session.on_transport(0, true, now);
  due_ = session.poll(now);
}

SessionOptions ScriptedLink::without_questions() {
  SessionOptions options;
  options.identify_interval = std::chrono::milliseconds{0};
  options.arming = Arming::off;
  return options;
}

SessionOptions ScriptedLink::must_arm() {
  SessionOptions options = without_questions();
  options.arming = Arming::required;
  return options;
}

void ScriptedLink::pass(Time duration) {
  const Time end = now + duration;
  due_ = session.poll(now);  // the test may have sent a command
  while (due_ <= end) {
    now = std::max(now, due_);
    due_ = session.poll(now);
    ASSERT_GT(due_, now) << "poll() must return a later time";
  }
  now = end;
}

std::uint32_t ScriptedLink::board_ms() const {
  return static_cast<std::uint32_t>(now.count() / 1000) + clock_offset_;
}

void ScriptedLink::raw(std::string_view bytes) {
  session.receive(0, bytes, now);
  due_ = session.poll(now);
}

void ScriptedLink::reboot() {
  clock_offset_ += 1'000'000'000;
  board_pnum = 1;
}

std::string ScriptedLink::stamp() {
  return "PNum:" + std::to_string(board_pnum++) + ";T:" + std::to_string(board_ms()) + ";";
}

void ScriptedLink::boot_heartbeat() { raw("H:R4-ROS2;PNum:0;T:0;^0xb10b3a06^"); }

void ScriptedLink::heartbeat(SafeReason reason) {
  const std::string safe =
      reason == SafeReason::none ? "" : "SAFE:" + std::to_string(static_cast<int>(reason)) + ";";
  raw(with_crc("H:R4-ROS2;" + stamp() + safe));
}

void ScriptedLink::stopped(std::uint32_t stop, int cause) {
  raw(with_crc("H:R4-ROS2;" + stamp() + "SAFE:2;CAUSE:" + std::to_string(cause) +
               ";STOP:" + std::to_string(stop) + ";"));
}

void ScriptedLink::state(std::string_view fields) { raw(with_crc(std::string(fields) + stamp())); }

void ScriptedLink::executed(std::uint32_t pnum) {
  state("AIN24:24.28;SAFE:0;CMD:" + std::to_string(pnum) + ";");
}

void ScriptedLink::send_states(int count, std::string_view fields) {
  for (; count != 0; --count) {
    pass(std::chrono::milliseconds{10});
    state(fields);
  }
}

void ScriptedLink::nack(std::uint32_t pnum, std::string_view code) {
  const std::string began =
      session_pnum == 0 ? "" : "SESSION:" + std::to_string(session_pnum) + ";";
  state("N:" + std::to_string(pnum) + "," + std::string(code) + ";" + began + asker());
}

void ScriptedLink::identity(std::string_view capabilities, bool names_question) {
  if (names_question && count('Q') != 0) return answer(last('Q').pnum, capabilities);
  state("I:R4,0.1.0,board-7," + std::string(capabilities) + ";" + asker());
}

void ScriptedLink::answer(std::uint32_t question, std::string_view capabilities) {
  state("I:R4,0.1.0,board-7," + std::string(capabilities) + ";ASKED:" + std::to_string(question) +
        ";" + asker());
}

std::string ScriptedLink::asker() const {
  if (host_session == no_session) return "";
  char digits[session_id_size];
  write_session_id(digits, host_session);
  return "SID:" + std::string(digits, sizeof digits) + ";";
}

void ScriptedLink::connect() {
  heartbeat();
  connect_after_heartbeat();
}

void ScriptedLink::connect_after_heartbeat() {
  pass(std::chrono::milliseconds{10});
  ASSERT_EQ(count('F'), 1U) << "the session must choose its fields when the link comes up";
  executed(last('F').pnum);
  session_pnum = last('H').pnum;
  ASSERT_TRUE(session.in_control(now));
  sent.clear();
}

std::vector<ScriptedLink::Sent> ScriptedLink::all(char letter) const {
  std::vector<Sent> found;
  for (const Sent& each : sent) {
    if (each.command.front() == letter) found.push_back(each);
  }
  return found;
}

ScriptedLink::Sent ScriptedLink::last(char letter) const {
  const std::vector<Sent> found = all(letter);
  if (found.empty()) {
    ADD_FAILURE() << "no datagram was sent with the letter " << letter;
    return {};
  }
  return found.back();
}

SendResult ScriptedLink::transmit(std::size_t, std::string_view bytes, Priority priority) {
  if (place_taken && priority != Priority::stop) return SendResult::busy;
  Datagram datagram;
  EXPECT_TRUE(read_datagram(bytes, datagram)) << bytes;
  host_session = datagram.session_id();
  const Field field = *datagram.begin();
  sent.push_back({str(field.name()) + ":" + str(field.values()), datagram.pnum(),
                  datagram.time_ms(), priority, now, std::string(bytes)});
  return SendResult::sent;
}

void ScriptedLink::on_identity(const Identity& identity) { board_id = str(identity.board_id); }

}  // namespace r4::test
