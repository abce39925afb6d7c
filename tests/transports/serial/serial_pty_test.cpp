// SPDX-License-Identifier: GPL-3.0-or-later
// The carriers serial and pty, connected by a real pseudo-terminal, and each carrier with a
// terminal of the test.
#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>

#include "../recorder.hpp"
#include "tests/support/problems.hpp"
#include "tests/support/refused_calls.hpp"
#include "transports/file_descriptor.hpp"
#include "transports/serial/pty_carrier.hpp"
#include "transports/serial/serial_carrier.hpp"

namespace r4::test {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

// Makes "serial:///dev/pts/5" from "pty:/dev/pts/5".
std::string url_for_host(const Carrier& board) { return "serial://" + board.name().substr(4); }

// A pseudo-terminal of the test: the far end of a serial carrier.
struct Terminal {
  Terminal() : master(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)) {
    std::array<char, 64> name{};
    if (::grantpt(master.get()) == 0 && ::unlockpt(master.get()) == 0 &&
        ::ptsname_r(master.get(), name.data(), name.size()) == 0) {
      device = name.data();
    }
  }
  FileDescriptor master;
  std::string device;
};

FileDescriptor open_raw(const std::string& device) {
  FileDescriptor terminal(::open(device.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  termios settings{};
  ::tcgetattr(terminal.get(), &settings);
  ::cfmakeraw(&settings);
  ::tcsetattr(terminal.get(), TCSANOW, &settings);
  return terminal;
}

// All bytes that can be read without waiting.
std::string read_all(const FileDescriptor& terminal) {
  std::string all;
  std::array<char, 4096> buffer{};
  for (ssize_t n; (n = ::read(terminal.get(), buffer.data(), buffer.size())) > 0;) {
    all.append(buffer.data(), static_cast<std::size_t>(n));
  }
  return all;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find("\r\n", at), text.size());
    if (end != at) lines.push_back(text.substr(at, end - at));
    at = end + 2;
  }
  return lines;
}

void write_text(const FileDescriptor& terminal, std::string_view text) {
  ASSERT_EQ(::write(terminal.get(), text.data(), text.size()), static_cast<ssize_t>(text.size()));
}

class SerialPtyTest : public testing::Test {
 protected:
  SerialPtyTest() {
    std::string pattern = fs::temp_directory_path() / "r4-serial-test-XXXXXX";
    folder = ::mkdtemp(pattern.data());
  }
  ~SerialPtyTest() override {
    std::error_code ignored;
    fs::remove_all(folder, ignored);
  }

  void open_board(const std::string& url = "pty:") {
    board = open_carrier(io, url, Role::board, at_board);
  }
  void open_host(const std::string& url) { host = open_carrier(io, url, Role::host, at_host); }
  void connect() {
    open_board();
    open_host(url_for_host(*board));
    ASSERT_TRUE(run_until(io, [&] { return board->up(); }));
  }
  bool wait_for(const Recorder& recorder, std::string_view text) {
    return run_until(io, [&] { return recorder.has(text); });
  }
  Problem host_problem(const std::string& url) {
    Recorder recorder;
    return problem_of([&] { open_carrier(io, url, Role::host, recorder); });
  }
  std::unique_ptr<Carrier> claimed(const Url& url, const DeviceClaim& claim, Recorder& recorder) {
    auto carrier = make_serial_carrier(io, url, Role::host, std::make_shared<DeviceClaim>(claim));
    carrier->open(recorder);
    return carrier;
  }

  asio::io_context io;
  Recorder at_board, at_host;
  std::unique_ptr<Carrier> board, host;
  fs::path folder;
};

TEST_F(SerialPtyTest, CarriesBothWays) {
  connect();
  EXPECT_TRUE(host->up());
  EXPECT_EQ(at_host.count(Kind::up), 1U);
  EXPECT_EQ(at_board.count(Kind::up), 1U);
  for (int i = 0; i < 50; ++i) {
    EXPECT_EQ(host->send("command " + std::to_string(i), Priority::normal), SendResult::sent);
    EXPECT_EQ(board->send("state " + std::to_string(i), Priority::normal), SendResult::sent);
  }
  ASSERT_TRUE(wait_for(at_board, "command 49"));
  ASSERT_TRUE(wait_for(at_host, "state 49"));
  EXPECT_EQ(at_board.datagrams.size(), 50U);
  EXPECT_EQ(at_host.datagrams.size(), 50U);
  EXPECT_EQ(at_host.datagrams[0].from, everyone);
  EXPECT_EQ(board->counters().rx_bytes, host->counters().tx_bytes);
  EXPECT_GE(at_host.drained, 1);
  const std::string longest(1024, 'x');
  EXPECT_EQ(host->send(longest + "x", Priority::normal), SendResult::full);
  EXPECT_EQ(host->send(longest, Priority::normal), SendResult::sent);
  EXPECT_TRUE(wait_for(at_board, longest));
}

TEST_F(SerialPtyTest, SetsOneMegabaudRawEightBits) {
  connect();
  const FileDescriptor look(
      ::open(board->name().substr(4).c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  termios settings{};
  ASSERT_EQ(::tcgetattr(look.get(), &settings), 0);
  EXPECT_EQ(::cfgetospeed(&settings), static_cast<speed_t>(B1000000));
  EXPECT_EQ(::cfgetispeed(&settings), static_cast<speed_t>(B1000000));
  EXPECT_EQ(settings.c_cflag & CSIZE, static_cast<tcflag_t>(CS8));
  EXPECT_EQ(settings.c_cflag & (PARENB | CSTOPB | CRTSCTS), 0U);
  EXPECT_EQ(settings.c_lflag & (ICANON | ECHO | ISIG), 0U);
  EXPECT_EQ(settings.c_iflag & (IXON | IXOFF | ICRNL | INLCR | IGNCR), 0U);
  EXPECT_EQ(settings.c_oflag & OPOST, 0U);
}

TEST_F(SerialPtyTest, NamesTheRateThatIsRefused) {
  open_board();
  const Problem problem = host_problem(url_for_host(*board) + "?baud=12345");
  EXPECT_EQ(problem.kind, ErrorKind::usage);
  EXPECT_TRUE(contains(problem.reason, "12345 baud"));
  open_host(url_for_host(*board) + "?baud=115200");
  EXPECT_EQ(host->name(), url_for_host(*board) + "?baud=115200");
}

TEST_F(SerialPtyTest, SeesTheHostCloseAndOpenAgain) {
  connect();
  double worst_down = 0;
  double worst_up = 0;
  for (std::size_t round = 1; round <= 20; ++round) {
    const auto closed = Clock::now();
    host->close();
    ASSERT_TRUE(run_until(io, [&] { return at_board.count(Kind::down) == round; }));
    EXPECT_FALSE(board->up());
    EXPECT_EQ(board->send("nobody is there", Priority::state), SendResult::down);
    worst_down = std::max(worst_down, in_milliseconds(at_board.last(Kind::down)->when - closed));
    const auto opened = Clock::now();
    host->open(at_host);
    ASSERT_TRUE(run_until(io, [&] { return at_board.count(Kind::up) == round + 1; }));
    worst_up = std::max(worst_up, in_milliseconds(at_board.last(Kind::up)->when - opened));
  }
  std::printf("[ host closed: board's down after %.2f ms; opened again: up after %.2f ms ]\n",
              worst_down, worst_up);
  EXPECT_LE(worst_down, 50);
  EXPECT_LE(worst_up, 1000);
  EXPECT_EQ(board->counters().downs, 20U);
  EXPECT_EQ(board->counters().ups, 21U);
  host->send("still working", Priority::normal);
  EXPECT_TRUE(wait_for(at_board, "still working"));
}

TEST_F(SerialPtyTest, ReconnectsToABoardThatReturnsAtItsPath) {
  const std::string link = folder / "board";
  open_board("pty:" + link);
  EXPECT_EQ(board->name(), "pty:" + link);
  open_host("serial://" + link);
  EXPECT_EQ(host->name(), "serial://" + link);
  double worst_down = 0;
  double worst_up = 0;
  for (std::size_t round = 1; round <= 5; ++round) {
    ASSERT_TRUE(run_until(io, [&] { return board->up() && host->up(); }));
    const auto gone = Clock::now();
    board->close();
    ASSERT_TRUE(run_until(io, [&] { return at_host.count(Kind::down) == round; }));
    worst_down = std::max(worst_down, in_milliseconds(at_host.last(Kind::down)->when - gone));
    EXPECT_EQ(host->send("lost", Priority::normal), SendResult::down);
    EXPECT_FALSE(at_host.last(Kind::down)->problem.reason.empty());
    EXPECT_FALSE(fs::exists(fs::symlink_status(link)));
    run_for(io, milliseconds(150));
    const auto back = Clock::now();
    board->open(at_board);
    ASSERT_TRUE(run_until(io, [&] { return at_host.count(Kind::up) == round + 1; }));
    worst_up = std::max(worst_up, in_milliseconds(at_host.last(Kind::up)->when - back));
  }
  std::printf("[ board gone: host's down after %.2f ms; back: up after %.2f ms ]\n", worst_down,
              worst_up);
  EXPECT_LE(worst_down, 50);
  EXPECT_LE(worst_up, 1000);
  EXPECT_EQ(at_host.count(Kind::warning), 0U);
  host->send("works again", Priority::normal);
  EXPECT_TRUE(wait_for(at_board, "works again"));
}

TEST_F(SerialPtyTest, ReportsOnceWhyAReturnedDeviceCannotBeOpened) {
  const std::string link = folder / "board";
  open_board("pty:" + link);
  open_host("serial://" + link);
  board.reset();
  ASSERT_TRUE(run_until(io, [&] { return at_host.count(Kind::down) == 1; }));
  std::ofstream(link) << "this is not a terminal";
  ASSERT_TRUE(run_until(io, [&] { return at_host.count(Kind::warning) == 1; }));
  EXPECT_EQ(at_host.last(Kind::warning)->problem.reason, "this file is not a serial port");
  run_for(io, milliseconds(250));
  EXPECT_EQ(at_host.count(Kind::warning), 1U);
  fs::remove(link);
  open_board("pty:" + link);
  EXPECT_TRUE(run_until(io, [&] { return at_host.count(Kind::up) == 2; }));
}

TEST_F(SerialPtyTest, WritesNothingWithoutAReader) {
  open_board();
  EXPECT_FALSE(board->up());
  EXPECT_EQ(board->send("stale", Priority::normal), SendResult::down);
  {
    const FileDescriptor first = open_raw(board->name().substr(4));
    ASSERT_TRUE(run_until(io, [&] { return board->up(); }));
    board->send("unread by the first host", Priority::normal);
  }
  board->send("between two hosts", Priority::normal);
  ASSERT_TRUE(run_until(io, [&] { return !board->up(); }));
  board->send("stale too", Priority::normal);
  open_host(url_for_host(*board));
  ASSERT_TRUE(run_until(io, [&] { return board->up(); }));
  board->send("fresh", Priority::normal);
  ASSERT_TRUE(wait_for(at_host, "fresh"));
  EXPECT_EQ(at_host.datagrams.size(), 1U);
}

TEST_F(SerialPtyTest, ReadsLinesAfterNoise) {
  const Terminal far;
  open_host("serial://" + far.device);
  std::string noise;
  for (int i = 0; i < 2000; ++i) noise += static_cast<char>(i * 31 % 256);
  write_text(far.master, noise);
  write_text(far.master, "\ngood 1\r\ncut in the mid");
  write_text(far.master, "dle\rgood 2\n\n\r\r\ngood 3\r");
  ASSERT_TRUE(wait_for(at_host, "good 3"));
  EXPECT_TRUE(at_host.has("good 1") && at_host.has("cut in the middle") && at_host.has("good 2"));
}

TEST_F(SerialPtyTest, CountsATooLongLineOnce) {
  open_board();
  const FileDescriptor host_end = open_raw(board->name().substr(4));
  ASSERT_TRUE(run_until(io, [&] { return board->up(); }));
  write_text(host_end, std::string(3000, 'x') + "\r\ngood\r\n");
  ASSERT_TRUE(wait_for(at_board, "good"));
  EXPECT_EQ(at_board.datagrams.size(), 1U) << at_board.datagrams.front().text;
  EXPECT_EQ(board->counters().rx_oversize, 1U);
  EXPECT_EQ(at_board.oversize, std::vector<std::string>{std::string(1024, 'x')});
}

TEST_F(SerialPtyTest, GivesAStalledReaderARecentStateFirst) {
  open_board();
  const FileDescriptor reader = open_raw(board->name().substr(4));
  ASSERT_TRUE(run_until(io, [&] { return board->up(); }));
  // An age is a number of states, not a time, because a machine with a standstill sends no states.
  constexpr int period_ms = 10;
  std::size_t sent = 0;
  std::size_t oldest = 0;
  // Stalls of different lengths and phases, with a state every 10 ms and a heartbeat every 50 ms.
  for (const int stall_ms : {5, 35, 41, 47, 53, 120, 250, 503}) {
    for (int left_ms = stall_ms; left_ms > 0; left_ms -= period_ms) {
      if (sent % 5 == 0) board->send("heartbeat", Priority::normal);
      board->send("state " + std::to_string(sent++) + std::string(150, '.'), Priority::state);
      run_for(io, milliseconds(std::min(left_ms, period_ms)));
    }
    pollfd readable{reader.get(), POLLIN, 0};
    ASSERT_EQ(::poll(&readable, 1, 1000), 1);
    const auto lines = lines_of(read_all(reader));
    const auto first = std::find_if(lines.begin(), lines.end(),
                                    [](const std::string& l) { return l.starts_with("state "); });
    ASSERT_NE(first, lines.end());
    EXPECT_EQ(first->find('.') + 150, first->size()) << "the first line was cut";
    oldest = std::max(oldest, sent - std::stoul(first->substr(6)));
  }
  EXPECT_LE(oldest, 50U / period_ms);
  EXPECT_GT(board->counters().tx_dropped, 0U);
}

TEST_F(SerialPtyTest, LosesNothingToAReaderThatKeepsUp) {
  connect();
  for (std::size_t i = 0; i < 300; ++i) {
    board->send("state " + std::to_string(i) + std::string(150, '.'), Priority::state);
    ASSERT_TRUE(run_until(io, [&] { return at_host.datagrams.size() == i + 1; }));
  }
  EXPECT_EQ(board->counters().tx_dropped, 0U);
}

// The far end does not read, so the lines of the host wait.
class StalledBoardTest : public SerialPtyTest {
 protected:
  StalledBoardTest() {
    open_host("serial://" + far.device);
    while (host->send(line(sent), Priority::normal) == SendResult::sent) ++sent;
  }
  static std::string line(int i) { return "line " + std::to_string(i) + std::string(150, '.'); }
  // Reads the lines at the far end up to `last`.
  std::vector<std::string> read_until(const std::string& last) {
    std::string text;
    const auto deadline = Clock::now() + patience;
    while (!text.ends_with(last + "\r\n") && Clock::now() < deadline) {
      text += read_all(far.master);
      run_for(io, milliseconds(1));
    }
    EXPECT_LT(Clock::now(), deadline);
    return lines_of(text);
  }

  Terminal far;
  int sent = 0;
};

TEST_F(StalledBoardTest, LetsAStopOvertakeWaitingLines) {
  EXPECT_EQ(host->send("one too many", Priority::normal), SendResult::full);
  EXPECT_EQ(host->send("state 1", Priority::state), SendResult::sent);
  EXPECT_EQ(host->send("state 2", Priority::state), SendResult::sent);
  EXPECT_EQ(host->send("stop", Priority::stop), SendResult::sent);
  const auto lines = read_until("state 2");
  // The system holds whole lines and one unfinished line. The stop follows, then the 64 waiting
  // lines.
  ASSERT_EQ(lines.size(), static_cast<std::size_t>(sent) + 2);
  const auto in_system = static_cast<std::size_t>(sent - 64);
  for (std::size_t i = 0; i < lines.size() - 1; ++i) {
    if (i == in_system) {
      EXPECT_EQ(lines[i], "stop");
    } else {
      EXPECT_EQ(lines[i], line(static_cast<int>(i < in_system ? i : i - 1)));
    }
  }
}

TEST_F(StalledBoardTest, DropsLinesAfter100MsButCompletesTheLineInProgress) {
  host->send("state", Priority::state);
  host->send("stop", Priority::stop);
  run_for(io, milliseconds(110));
  const auto lines = read_until("stop");
  ASSERT_EQ(lines.size(), static_cast<std::size_t>(sent - 64) + 1);
  for (std::size_t i = 0; i + 1 < lines.size(); ++i) {
    EXPECT_EQ(lines[i], line(static_cast<int>(i)));
  }
  EXPECT_EQ(lines.back(), "stop");
  EXPECT_EQ(host->send("fresh", Priority::normal), SendResult::sent);
  EXPECT_EQ(read_until("fresh"), std::vector<std::string>{"fresh"});
  EXPECT_EQ(host->counters().tx_dropped, 64U + 1 + 1);
}

TEST_F(SerialPtyTest, SaysThatADeviceIsInUse) {
  connect();
  const Problem problem = host_problem(url_for_host(*board));
  EXPECT_EQ(problem.kind, ErrorKind::open);
  EXPECT_EQ(problem.reason, "the port is in use by another program");
  EXPECT_FALSE(problem.fix.empty());
  host->close();
  host->open(at_host);
}

TEST_F(SerialPtyTest, AYieldingProgramLosesTheDeviceAndIsSilent) {
  const Terminal terminal;
  const Url url = Url::parse("serial://" + terminal.device);
  int lost_first = 0;
  int lost_second = 0;
  const DeviceClaim controls{false, false}, takes{false, true},
      yields{true, false, [&] { ++lost_first; }},
      takes_and_yields{true, true, [&] { ++lost_second; }};
  Recorder first, second, third;
  const auto one = claimed(url, yields, first);
  write_text(terminal.master, "for the first\r\n");
  ASSERT_TRUE(wait_for(first, "for the first"));
  for (const auto& claim : {controls, yields})
    EXPECT_TRUE(error_of([&] { claimed(url, claim, second); }))
        << "these claims do not take the port";

  const auto two = claimed(url, takes_and_yields, second);
  EXPECT_TRUE(error_of([&] { claimed(url, takes_and_yields, third); }))
      << "both programs would take the port in turn";
  const auto three = claimed(url, takes, third);
  for (int i = 0; i < 20; ++i) {
    write_text(terminal.master, fmt::format("for the third {}\r\n", i));
    ASSERT_TRUE(wait_for(third, fmt::format("for the third {}", i)));
  }
  EXPECT_EQ(lost_first, 1);
  EXPECT_EQ(lost_second, 1);
  EXPECT_EQ(first.datagrams.size(), 1U);
  EXPECT_TRUE(second.datagrams.empty());
  EXPECT_FALSE(one->up());
  EXPECT_EQ(two->send("late", Priority::normal), SendResult::down);
  for (const auto& claim : {takes, takes_and_yields, yields, controls})
    EXPECT_TRUE(error_of([&] { claimed(url, claim, second); })) << "the holder does not yield";
  EXPECT_EQ(read_all(terminal.master), "");
}

TEST_F(SerialPtyTest, ASendReportsThatTheDeviceWasTaken) {
  const Terminal terminal;
  const Url url = Url::parse("serial://" + terminal.device);
  const auto one = claimed(url, {true, false}, at_host);
  EXPECT_EQ(one->send("mine", Priority::normal), SendResult::sent);
  Recorder other;
  const auto two = claimed(url, {false, true}, other);
  EXPECT_EQ(one->send("late", Priority::normal), SendResult::down);
  EXPECT_EQ(lines_of(read_all(terminal.master)), std::vector<std::string>{"mine"});
  EXPECT_TRUE(run_until(io, [&] { return !one->up(); }));
}

TEST_F(SerialPtyTest, NamesAMissingDeviceAndOneThatIsNotASerialPort) {
  std::ofstream(folder / "file") << "text";
  const std::string missing = "the device does not exist";
  const std::string other = "this file is not a serial port";
  for (const auto& [path, reason] : std::map<std::string, std::string>{
           {"/dev/ttyACM99", missing},
           {"/dev/pts/99999", missing},
           {"/no/such/folder/tty", missing},
           {"/dev/null", other},
           {folder, other},
           {folder / "file", other},
       }) {
    const Problem problem = host_problem("serial://" + path);
    EXPECT_EQ(problem.kind, ErrorKind::open);
    EXPECT_EQ(problem.thing, path);
    EXPECT_EQ(problem.reason, reason) << path;
    EXPECT_TRUE(contains(problem.fix, "ports"));
  }
  const Problem by_number = host_problem("serial:?sn=no-such-number");
  EXPECT_EQ(by_number.kind, ErrorKind::open);
  EXPECT_TRUE(contains(by_number.reason, "'no-such-number'"));
}

TEST_F(SerialPtyTest, SaysHowToGetPermission) {
  const Terminal far;
  ASSERT_EQ(::chmod(far.device.c_str(), 0), 0);
  const int status = run_unprivileged([&] {
    const Problem problem = host_problem("serial://" + far.device);
    if (problem.kind != ErrorKind::permission) return 1;
    return contains(problem.fix, "usermod -aG dialout") ? 0 : 2;
  });
  EXPECT_EQ(status, 0);
}

TEST_F(SerialPtyTest, ReplacesALinkAndNothingElse) {
  const fs::path path = folder / "board";
  std::ofstream(path) << "precious";
  const auto error = error_of([&] { open_board("pty:" + path.string()); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->kind(), ErrorKind::open);
  EXPECT_TRUE(fs::is_regular_file(path));
  fs::rename(path, folder / "precious");
  fs::create_symlink(folder / "precious", path);
  ASSERT_TRUE(error_of([&] { open_board("pty:" + path.string()); }))
      << "the link does not lead to a pty";
  EXPECT_EQ(fs::read_symlink(path), folder / "precious");
  fs::remove(path);
  fs::create_symlink("/nowhere", path);
  open_board("pty:" + path.string());
  EXPECT_EQ(fs::read_symlink(path).parent_path(), "/dev/pts");
  Recorder recorder;
  const auto successor = open_carrier(io, "pty:" + path.string(), Role::board, recorder);
  board->close();
  EXPECT_TRUE(fs::exists(path)) << "the link belongs to the successor";
  successor->close();
  EXPECT_FALSE(fs::exists(fs::symlink_status(path)));
  const auto no_folder = error_of([&] { open_board("pty:" + (folder / "no" / "board").string()); });
  ASSERT_TRUE(no_folder);
  EXPECT_EQ(no_folder->kind(), ErrorKind::open);
}

TEST_F(SerialPtyTest, CallsNoHandlerAfterClose) {
  const Terminal far;
  open_host("serial://" + far.device);
  at_host.then = [&](const Recorder::Datagram&) { host->close(); };
  write_text(far.master, "1\r\n2\r\n3\r\n");
  ASSERT_TRUE(wait_for(at_host, "1"));
  run_for(io, milliseconds(5));
  EXPECT_EQ(at_host.datagrams.size(), 1U);
  EXPECT_EQ(at_host.drained, 0);
  host->open(at_host);
  at_host.then = nullptr;
  write_text(far.master, "4\r\n");
  EXPECT_TRUE(wait_for(at_host, "4"));
}

TEST_F(SerialPtyTest, LeaksNoDescriptorsOver30Reopenings) {
  const std::string link = folder / "board";
  open_board("pty:" + link);
  open_host("serial://" + link);
  ASSERT_TRUE(run_until(io, [&] { return board->up(); }));
  const std::size_t before = open_descriptors();
  for (int i = 0; i < 30; ++i) {
    host->close();
    board->open(at_board);
    host->open(at_host);
    ASSERT_TRUE(run_until(io, [&] { return board->up(); }));
    host->send(std::to_string(i), Priority::normal);
    ASSERT_TRUE(wait_for(at_board, std::to_string(i)));
  }
  EXPECT_LE(open_descriptors(), before);
}

// The host gets an error. The board must continue: it reports one warning and tries again.
TEST_F(SerialPtyTest, ARefusedWatchIsAHostErrorAndABoardWarning) {
  in_a_thread_of_its_own([&] {
    open_board();
    refuse(no_watches);
    const std::string reason = "this user has reached the limit of epoll watches";
    EXPECT_EQ(host_problem(url_for_host(*board)).reason, reason);
    const FileDescriptor terminal = open_raw(board->name().substr(4));
    ASSERT_TRUE(run_until(io, [&] { return at_board.count(Kind::warning) != 0; }));
    EXPECT_EQ(at_board.last(Kind::warning)->problem.reason, reason);
    run_for(io, milliseconds(100));
    EXPECT_EQ(at_board.count(Kind::warning), 1U);
    EXPECT_FALSE(board->up());
  });
}

}  // namespace
}  // namespace r4::test
