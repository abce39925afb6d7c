// SPDX-License-Identifier: GPL-3.0-or-later
// Our ISO-TP engine and the kernel's engine on one bus, with faults. For tools/with-can.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <exception>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>

#include "tests/transports/can/kernel/isotp_on_raw_can.hpp"
#include "tests/transports/can/kernel/kernel_isotp.hpp"
#include "tests/transports/can/kernel/raw_can.hpp"

namespace r4::test {
namespace {

constexpr std::uint32_t capacity = 1024;

// The timeouts under test, and how late a slow machine may detect them.
constexpr std::uint32_t time_out_us = 200000;
constexpr std::uint32_t lateness_us = 1000000;

IsotpSenderOptions hasty_sender() {
  IsotpSenderOptions options = sender_of(classic);
  options.n_bs_us = time_out_us;
  return options;
}

struct EngineReceiver {
  explicit EngineReceiver(const IsotpReceiverOptions& options)
      : receiver(options, buffer.data(), capacity) {}
  std::string received() const { return {receiver.text().data(), receiver.text().size()}; }

  std::string buffer = std::string(capacity, '\0');
  IsotpReceiver receiver;
};

// A separate process that can be killed. Returns when the process has opened its socket.
class Peer {
 public:
  explicit Peer(const std::function<void(const std::function<void()>& ready)>& life) {
    int opened[2];
    if (pipe(opened) != 0) throw std::system_error(errno, std::generic_category(), "pipe");
    process_ = fork();
    if (process_ == 0) {
      prctl(PR_SET_PDEATHSIG, SIGKILL);
      try {
        life([&] { static_cast<void>(!write(opened[1], "", 1)); });
        for (;;) pause();
      } catch (const std::exception&) {
        _exit(1);
      }
    }
    char byte;
    close(opened[1]);
    const bool is_open = read(opened[0], &byte, 1) == 1;
    close(opened[0]);
    if (!is_open) throw std::runtime_error("the peer has not opened its socket");
  }
  ~Peer() { kill_now(); }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  // On return the process and its socket have ended.
  void kill_now() {
    if (process_ <= 0) return;
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
    process_ = -1;
  }

 private:
  pid_t process_ = -1;
};

TEST(KernelIsotpFaults, KernelReportsMissingPadding) {
  KernelIsotp kernel(data_id, flow_control_id, kernel_of(forms[1]));
  RawCan bus(flow_control_id);
  IsotpSender sender(sender_of(classic));
  drive(bus, sender, content_of(5));
  EXPECT_EQ(kernel.receive(patience_us), std::nullopt);
  EXPECT_EQ(kernel.error(), EBADMSG);
}

// For each lost frame: no damaged datagram is delivered, and the next transfer succeeds. The last
// frame of the damaged datagram is full, because both engines ignore a short frame before the last
// frame.
constexpr std::uint32_t damaged_size = 174;
constexpr unsigned last_frame = 24;

TEST(KernelIsotpFaults, ALostFrameOfTheEngineCostsOnlyItsDatagram) {
  KernelIsotp kernel(data_id, flow_control_id, kernel_of(classic));
  RawCan bus(flow_control_id);
  IsotpSender sender(hasty_sender());
  const std::string datagram = content_of(170);
  for (unsigned lost = 0; lost < last_frame; ++lost) {
    const Course course =
        drive(bus, sender, content_of(damaged_size), [&](unsigned frame) { return frame == lost; });
    EXPECT_EQ(course.error, lost == 0 ? IsotpError::flow_control_timeout : IsotpError::none);
    EXPECT_EQ(kernel.error(lost == 0 ? 0 : patience_us), lost == 0 ? 0 : EILSEQ)
        << "frame " << lost;
    EXPECT_EQ(drive(bus, sender, datagram).error, IsotpError::none);
    EXPECT_TRUE(kernel.receive() == datagram) << "after the loss of frame " << lost;
    EXPECT_EQ(kernel.receive(0), std::nullopt);
  }
}

TEST(KernelIsotpFaults, ALostFrameOfTheKernelCostsOnlyItsDatagram) {
  KernelIsotp kernel(flow_control_id, data_id, kernel_of(classic));
  RawCan bus(data_id);
  IsotpReceiverOptions options = receiver_of(classic);
  options.n_cr_us = time_out_us;
  EngineReceiver engine(options);
  const std::string datagram = content_of(170);
  for (unsigned lost = 1; lost <= last_frame; ++lost) {
    kernel.send(content_of(damaged_size));
    const Course course =
        drive(bus, engine.receiver, [&](unsigned frame) { return frame == lost; });
    EXPECT_EQ(course.error, lost == last_frame ? IsotpError::consecutive_timeout
                                               : IsotpError::wrong_sequence_number)
        << "frame " << lost;
    kernel.send(datagram);
    EXPECT_EQ(drive(bus, engine.receiver).error, IsotpError::none);
    EXPECT_TRUE(engine.received() == datagram) << "after the loss of frame " << lost;
  }
  EXPECT_EQ(engine.receiver.counters().datagrams, last_frame);
}

TEST(KernelIsotpFaults, EngineReportsThatTheKernelHasNoRoom) {
  KernelIsotp kernel(data_id, flow_control_id, kernel_of(classic));
  RawCan bus(flow_control_id);
  IsotpSender sender(sender_of(classic));
  const Course course = drive(bus, sender, content_of(4000000));
  EXPECT_EQ(course.error, IsotpError::overflow);
  EXPECT_EQ(course.frames, 1U);
}

TEST(KernelIsotpFaults, KernelReportsThatTheEngineHasNoRoom) {
  KernelIsotp kernel(flow_control_id, data_id, kernel_of(classic));
  RawCan bus(data_id);
  EngineReceiver engine(receiver_of(classic));
  kernel.send(content_of(capacity + 1));
  const Course course = drive(bus, engine.receiver);
  EXPECT_EQ(course.error, IsotpError::overflow);
  EXPECT_EQ(course.answers, 1U);
  EXPECT_EQ(kernel.error(patience_us), EMSGSIZE);
  kernel.send(content_of(capacity));
  EXPECT_EQ(drive(bus, engine.receiver).error, IsotpError::none);
  EXPECT_TRUE(engine.received() == content_of(capacity));
}

TEST(KernelIsotpFaults, EngineEndsWithN_BsWithoutAnAnswer) {
  RawCan bus(flow_control_id);
  IsotpSender sender(hasty_sender());
  const Course course = drive(bus, sender, content_of(100));
  EXPECT_EQ(course.error, IsotpError::flow_control_timeout);
  EXPECT_EQ(course.frames, 1U);
  EXPECT_GE(course.silence_us, time_out_us);
  EXPECT_LT(course.silence_us, time_out_us + lateness_us);
}

TEST(KernelIsotpFaults, EngineEndsWithN_BsWhenTheKernelsProcessIsKilledInTheMiddle) {
  KernelIsotpOptions blocks = kernel_of(classic);
  blocks.block_size = 8;
  Peer peer([&](const std::function<void()>& ready) {
    KernelIsotp kernel(data_id, flow_control_id, blocks);
    ready();
    for (;;) pause();
  });
  RawCan bus(flow_control_id);
  IsotpSender sender(hasty_sender());
  const Course course = drive(bus, sender, content_of(1024), [&](unsigned frame) {
    if (frame == 20) peer.kill_now();  // in the third block
    return false;
  });
  EXPECT_EQ(course.error, IsotpError::flow_control_timeout);
  EXPECT_EQ(course.frames, 1U + 3 * 8);
  EXPECT_EQ(course.answers, 3U);
  EXPECT_GE(course.silence_us, time_out_us);
  EXPECT_LT(course.silence_us, time_out_us + lateness_us);

  KernelIsotp restarted(data_id, flow_control_id, blocks);
  EXPECT_EQ(drive(bus, sender, content_of(1000)).error, IsotpError::none);
  EXPECT_TRUE(restarted.receive() == content_of(1000));
}

// The kernel finishes the transfer of a killed process. So the killed process runs our sender,
// which cannot finish.
TEST(KernelIsotpFaults, EngineEndsWithN_CrWhenTheSendersProcessIsKilledInTheMiddle) {
  RawCan bus(data_id);
  Peer peer([](const std::function<void()>& ready) {
    RawCan its_bus(flow_control_id);
    IsotpSender sender(sender_of(classic));
    ready();
    drive(its_bus, sender, content_of(capacity));
  });
  IsotpReceiverOptions options = receiver_of(classic);
  options.stmin = 10;
  options.n_cr_us = time_out_us;
  EngineReceiver engine(options);
  const Course course = drive(bus, engine.receiver, [&](unsigned frame) {
    if (frame == 20) peer.kill_now();
    return false;
  });
  EXPECT_EQ(course.error, IsotpError::consecutive_timeout);
  EXPECT_GE(course.frames, 20U);
  EXPECT_LT(course.frames, 100U);
  EXPECT_GE(course.silence_us, time_out_us);
  EXPECT_LT(course.silence_us, time_out_us + lateness_us);

  KernelIsotp restarted(flow_control_id, data_id, kernel_of(classic));
  restarted.send(content_of(100));
  EXPECT_EQ(drive(bus, engine.receiver).error, IsotpError::none);
  EXPECT_TRUE(engine.received() == content_of(100));
}

}  // namespace
}  // namespace r4::test
