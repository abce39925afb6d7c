// SPDX-License-Identifier: GPL-3.0-or-later
#include "bus_log.hpp"

#include <fmt/format.h>

namespace r4::test {

std::string to_text(const BusLog::Transfer& transfer) {
  using Kind = sim::I2cTransfer::Kind;
  if (transfer.kind == Kind::recover) return "recover";
  std::string text = fmt::format("{:02X}", transfer.address);
  if (!transfer.written.empty() || transfer.kind == Kind::write) {
    text += fmt::format(" <- {:02X}", fmt::join(transfer.written, " "));
  }
  if (!transfer.read.empty()) text += fmt::format(" -> {:02X}", fmt::join(transfer.read, " "));
  if (transfer.result == firmware::I2cResult::no_acknowledge) text += " NACK";
  if (transfer.result == firmware::I2cResult::timeout) text += " TIMEOUT";
  return text;
}

std::vector<std::string> lines(const BusLog& log) {
  std::vector<std::string> all;
  for (const BusLog::Transfer& transfer : log.transfers()) all.push_back(to_text(transfer));
  return all;
}

std::vector<std::string> writes(const BusLog& log) {
  std::vector<std::string> all;
  for (const BusLog::Transfer& transfer : log.transfers()) {
    if (transfer.kind == sim::I2cTransfer::Kind::write) all.push_back(to_text(transfer));
  }
  return all;
}

BusCost cost(const BusLog& log) {
  BusCost sum;
  for (const BusLog::Transfer& transfer : log.transfers()) {
    sum.bytes += transfer.bytes;
    sum.us += static_cast<double>(transfer.duration_ns) / 1000;
  }
  return sum;
}

}  // namespace r4::test
