// SPDX-License-Identifier: GPL-3.0-or-later
// The tools isotpsend and isotprecv of can-utils with our ISO-TP engine. For tools/with-can. Both
// tools use the ISO-TP sockets of the kernel. kernel_isotp_test.cpp tests every length.
#include <gtest/gtest.h>
#include <stdio.h>

#include <cerrno>
#include <string>
#include <system_error>
#include <utility>

#include "tests/transports/can/kernel/isotp_on_raw_can.hpp"
#include "tests/transports/can/kernel/raw_can.hpp"

namespace r4::test {
namespace {

constexpr std::uint32_t sizes[] = {63, 1024};

// A shell command that runs in parallel to the test.
class Program {
 public:
  explicit Program(const std::string& command) : output_(popen(command.c_str(), "r")) {
    if (output_ == nullptr) throw std::system_error(errno, std::generic_category(), command);
  }
  ~Program() { end(); }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  // The complete output of the command.
  std::string output() {
    std::string text;
    for (int byte; (byte = fgetc(output_)) != EOF;) text += static_cast<char>(byte);
    return text;
  }
  // Waits for the end of the command. Returns its exit status.
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

// The frames are padded. kernel_isotp_test.cpp also tests the forms without padding.
class CanUtils : public testing::TestWithParam<Form> {};
INSTANTIATE_TEST_SUITE_P(, CanUtils, testing::Values(forms[1], forms[3]),
                         [](const auto& form) { return form.param.name; });

TEST_P(CanUtils, IsotprecvPrintsDatagramsOfTheEngine) {
  RawCan bus(flow_control_id);
  IsotpSenderOptions options = sender_of(GetParam());
  options.n_bs_us = 100000;
  IsotpSender sender(options);
  for (const std::uint32_t size : sizes) {
    // A single frame does not show whether a program receives.
    if (size < GetParam().tx_dl - 1U) continue;
    const std::string datagram = content_of(size);
    Program program("timeout 10 isotprecv -s 200 -d 180 -b 8 -P l" + link_options(GetParam()));
    const std::uint32_t until_us = clock_us() + 5000000;
    while (drive(bus, sender, datagram).error == IsotpError::flow_control_timeout &&
           !reached(clock_us(), until_us)) {
      // The program isotprecv has not bound its socket yet.
    }
    EXPECT_EQ(sender.error(), IsotpError::none);
    EXPECT_EQ(program.output(), hex_of(datagram) + "\n");
    EXPECT_EQ(program.end(), 0);
  }
}

TEST_P(CanUtils, IsotpsendSendsDatagramsToTheEngine) {
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

}  // namespace
}  // namespace r4::test
