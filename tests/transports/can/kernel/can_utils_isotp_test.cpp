// SPDX-License-Identifier: GPL-3.0-or-later
// can-utils' isotpsend and isotprecv against our ISO-TP engine. For tools/with-can.
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <deque>
#include <string>
#include <system_error>
#include <utility>

#include "tests/transports/can/kernel/isotp_on_raw_can.hpp"
#include "tests/transports/can/kernel/raw_can.hpp"

namespace r4::test {
namespace {

constexpr std::uint32_t sizes[] = {8, 63, 170, 1024};

// A shell command that runs beside us.
class Program {
 public:
  explicit Program(const std::string& command) : output_(popen(command.c_str(), "r")) {
    if (output_ == nullptr) throw std::system_error(errno, std::generic_category(), command);
  }
  ~Program() { end(); }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  // All that it printed up to its end.
  std::string output() {
    std::string text;
    for (int byte; (byte = fgetc(output_)) != EOF;) text += static_cast<char>(byte);
    return text;
  }
  // The next line that it prints.
  std::string line() {
    std::string text;
    for (int byte; (byte = fgetc(output_)) != EOF && byte != '\n';) text += static_cast<char>(byte);
    return text;
  }
  // Waits for its end; its status.
  int end() { return output_ == nullptr ? -1 : pclose(std::exchange(output_, nullptr)); }

 private:
  FILE* output_;
};

// "61 62 " for "ab".
std::string hex_of(const std::string& bytes) {
  std::string hex;
  for (const char byte : bytes) {
    char digits[4];
    snprintf(digits, sizeof digits, "%02X ", static_cast<unsigned char>(byte));
    hex += digits;
  }
  return hex;
}

std::string link_options(const Form& form) {
  return std::string(form.padding ? " -p CC:CC" : "") + (form.tx_dl > 8 ? " -L 72:64:0" : "") +
         " " + can_interface;
}

// With padding; CanUtilsLengths is without.
class CanUtils : public testing::TestWithParam<Form> {};
INSTANTIATE_TEST_SUITE_P(, CanUtils, testing::Values(forms[1], forms[3]),
                         [](const auto& form) { return form.param.name; });

TEST_P(CanUtils, IsotprecvPrintsWhatTheEngineSends) {
  RawCan bus(flow_control_id);
  IsotpSenderOptions options = sender_of(GetParam());
  options.n_bs_us = 100000;
  IsotpSender sender(options);
  for (const std::uint32_t size : sizes) {
    if (size < GetParam().tx_dl - 1U) continue;  // a single frame tells nothing about a listener
    const std::string datagram = content_of(size);
    Program program("timeout 10 isotprecv -s 200 -d 180 -b 8 -P l" + link_options(GetParam()));
    const std::uint32_t until_us = clock_us() + 5000000;
    while (drive(bus, sender, datagram).error == IsotpError::flow_control_timeout &&
           !reached(clock_us(), until_us)) {
      // isotprecv has not bound its socket yet
    }
    EXPECT_EQ(sender.error(), IsotpError::none);
    EXPECT_EQ(program.output(), hex_of(datagram) + "\n");
    EXPECT_EQ(program.end(), 0);
  }
}

TEST_P(CanUtils, IsotpsendSendsTheEngineWhatItReads) {
  RawCan bus(data_id);
  std::string buffer(1024, '\0');
  IsotpReceiverOptions options = receiver_of(GetParam());
  options.block_size = 8;
  IsotpReceiver receiver(options, buffer.data(), 1024);
  for (const std::uint32_t size : sizes) {
    const std::string datagram = content_of(size);
    Program program("echo " + hex_of(datagram) + "| timeout 10 isotpsend -b -s 180 -d 200 -P l" +
                    link_options(GetParam()));
    EXPECT_EQ(drive(bus, receiver).error, IsotpError::none);
    EXPECT_EQ(hex_of({receiver.text().data(), receiver.text().size()}), hex_of(datagram));
    EXPECT_EQ(program.end(), 0);
  }
}

// Without padding, in many lengths.
class CanUtilsLengths : public testing::TestWithParam<Form> {};
INSTANTIATE_TEST_SUITE_P(, CanUtilsLengths, testing::Values(forms[0], forms[2]),
                         [](const auto& form) { return form.param.name; });

TEST_P(CanUtilsLengths, OfTheEngineIsPrintedByOneIsotprecv) {
  RawCan bus(flow_control_id);
  // Line by line, whatever its output is; its first line is how to end it.
  Program program("echo $$; exec timeout 60 stdbuf -oL isotprecv -l -s 200 -d 180 -P l" +
                  link_options(GetParam()));
  const pid_t process = std::atoi(program.line().c_str());
  ASSERT_GT(process, 0);
  IsotpSenderOptions impatient = sender_of(GetParam());
  impatient.n_bs_us = 100000;
  const std::string first = content_of(longest_datagram);
  IsotpSender finding(impatient);
  const std::uint32_t until_us = clock_us() + 5000000;
  while (drive(bus, finding, first).error == IsotpError::flow_control_timeout &&
         !reached(clock_us(), until_us)) {
    // it has not bound its socket yet
  }
  EXPECT_EQ(program.line(), hex_of(first));
  IsotpSender sender(sender_of(GetParam()));
  std::uint32_t datagrams = 0;
  for (std::uint32_t size = 1; size <= longest_datagram && !HasFailure();
       size = next_length(size), ++datagrams) {
    const std::string datagram = content_of(size);
    EXPECT_EQ(drive(bus, sender, datagram).error, IsotpError::none) << size;
    EXPECT_EQ(program.line(), hex_of(datagram)) << size;
  }
  EXPECT_EQ(sender.counters().datagrams, datagrams);
  ::kill(process, SIGTERM);
}

// Each length takes a process of its own, and the emulated machine some 80 ms for it.
constexpr std::uint32_t next_costly_length(std::uint32_t size) {
  return size < 24 ? size + 1 : size + 51;
}

// isotpsend without a shell around it. Its exit status.
class Isotpsend {
 public:
  Isotpsend(const Form& form, const std::string& datagram) {
    const std::string text = hex_of(datagram);
    const int input = memfd_create("input", MFD_CLOEXEC);
    if (write(input, text.data(), text.size()) != static_cast<ssize_t>(text.size()) ||
        lseek(input, 0, SEEK_SET) != 0) {
      throw std::system_error(errno, std::generic_category(), "memfd");
    }
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
    const char* const words[] = {"isotpsend",   "-b",   "-s", "180",
                                 "-d",          "200",  "-L", form.tx_dl > 8 ? "72:64:0" : "16:8:0",
                                 can_interface, nullptr};
    const int error = posix_spawnp(&process_, words[0], &actions, nullptr,
                                   const_cast<char* const*>(words), environ);
    posix_spawn_file_actions_destroy(&actions);
    close(input);
    if (error != 0) throw std::system_error(error, std::generic_category(), words[0]);
  }
  ~Isotpsend() { end(); }
  Isotpsend(const Isotpsend&) = delete;
  Isotpsend& operator=(const Isotpsend&) = delete;

  int end() {
    int status = -1;
    if (process_ > 0) waitpid(std::exchange(process_, -1), &status, 0);
    return status;
  }

 private:
  pid_t process_ = -1;
};

TEST_P(CanUtilsLengths, OfIsotpsendIsTakenByTheEngine) {
  RawCan bus(data_id);
  std::string buffer(longest_datagram, '\0');
  IsotpReceiver receiver(receiver_of(GetParam()), buffer.data(), longest_datagram);
  // The kernel takes its time to close a socket: meanwhile the next one sends.
  std::deque<Isotpsend> ending;
  for (std::uint32_t size = 1; size <= longest_datagram && !HasFailure();
       size = next_costly_length(size)) {
    const std::string datagram = content_of(size);
    ending.emplace_back(GetParam(), datagram);
    EXPECT_EQ(drive(bus, receiver).error, IsotpError::none) << size;
    EXPECT_TRUE(receiver.text() == Text(datagram.data(), datagram.size())) << size;
    for (; ending.size() > 3; ending.pop_front()) EXPECT_EQ(ending.front().end(), 0) << size;
  }
  for (Isotpsend& program : ending) EXPECT_EQ(program.end(), 0);
}

}  // namespace
}  // namespace r4::test
