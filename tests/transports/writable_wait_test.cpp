// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/writable_wait.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstddef>

#include "transports/file_descriptor.hpp"

namespace r4 {
namespace {

class WritableWaitTest : public testing::Test {
 protected:
  void SetUp() override {
    int pair[2];
    ASSERT_EQ(0, ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair));
    writer.reset(pair[0]);
    reader.reset(pair[1]);
  }
  void fill() {
    while (::write(writer.get(), bytes.data(), bytes.size()) > 0) {
    }
  }
  void drain() {
    while (::read(reader.get(), bytes.data(), bytes.size()) > 0) {
    }
  }

  std::array<std::byte, 4096> bytes{};
  asio::io_context io{1};
  FileDescriptor writer, reader;
  int calls = 0;
};

TEST_F(WritableWaitTest, CallsOnceWhenThereIsRoom) {
  WritableWait wait(io);
  fill();
  wait.start(writer.get(), [this] { ++calls; });
  wait.start(writer.get(), [this] { calls += 100; });
  io.poll();
  EXPECT_EQ(calls, 0);
  drain();
  io.run();
  EXPECT_EQ(calls, 1);
}

TEST_F(WritableWaitTest, DoesNotCallAfterStop) {
  WritableWait wait(io);
  wait.start(writer.get(), [this] { ++calls; });
  wait.stop();
  io.run();
  EXPECT_EQ(calls, 0);
}

TEST_F(WritableWaitTest, CallsEvenIfNoDescriptorIsLeft) {
  WritableWait wait(io);
  rlimit before{};
  ASSERT_EQ(0, ::getrlimit(RLIMIT_NOFILE, &before));
  const int next = ::dup(writer.get());
  ASSERT_GE(next, 0);
  ::close(next);
  const rlimit none{static_cast<rlim_t>(next), before.rlim_max};
  ASSERT_EQ(0, ::setrlimit(RLIMIT_NOFILE, &none));
  wait.start(writer.get(), [&] {
    ++calls;
    wait.start(writer.get(), [this] { ++calls; });
  });
  io.run_one();
  ASSERT_EQ(0, ::setrlimit(RLIMIT_NOFILE, &before));
  EXPECT_EQ(calls, 1);
  io.run();
  EXPECT_EQ(calls, 2);
}

}  // namespace
}  // namespace r4
