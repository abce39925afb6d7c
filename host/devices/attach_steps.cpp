// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "../async/async_board_impl.hpp"
#include "device_steps.hpp"

namespace r4 {

// Sends a device's steps, then its fields. The handler gets the last result or the first failure:
//     command --confirmed--> answer --as described--> pause --over--> next command
//        |                                                                ^
//        +---- confirmed, without an answer (X:POLL, F) ------------------+
class AsyncBoard::AttachSteps final : public Impl::Sequence {
 public:
  AttachSteps(Impl& impl, Device device, Time timeout, CompletionPtr completion)
      : Sequence(impl, std::move(completion)),
        device_(std::move(device)),
        steps_(steps_of(device_)),
        timeout_(timeout) {
    impl_.attaching.push_back(&device_);
  }
  ~AttachSteps() override { std::erase(impl_.attaching, &device_); }

  void begin() {
    stage_ = Stage::command;
    deadline_ = Impl::steady_now() + timeout_;
    send(has_step() ? step().command() : Command::fields(Text(fields_)), timeout_);
  }
  void complete(const CommandResult& result, How how) override {
    if (result.outcome != Outcome::confirmed) return fail(result, how);
    CommandResult failure = result;
    if (impl_.boots != boots_) {  // the board has lost the earlier steps
      failure.outcome = Outcome::cancelled;
      return fail(failure, how);
    }
    switch (stage_) {
      case Stage::command:
        if (has_step() && step().is_answered()) {
          stage_ = Stage::answer;
          return wait(Impl::Waits::For::answer, result.pnum, deadline_);
        }
        break;
      case Stage::answer: {
        const I2cAnswer& answer = impl_.session.state().i2c_answer;
        if (trouble_with(device_, step(), answer)) {
          failure.outcome = Outcome::refused;
          failure.transfer = answer;
          return fail(failure, how);
        }
        stage_ = Stage::pause;
        return wait(Impl::Waits::For::time, 0, impl_.now + step().wait);
      }
      case Stage::pause:
        break;
    }
    if (!has_step()) return end(result, how);  // after the fields
    if (++done_ == steps_.size()) {
      impl_.describe(device_);
      fields_ = fields_with(impl_.session.fields(), device_);
      if (fields_.empty()) return end(result, how);
    }
    begin();
  }

 private:
  enum class Stage : std::uint8_t { command, answer, pause };

  bool has_step() const { return done_ < steps_.size(); }
  const DeviceStep& step() const { return steps_[done_]; }

  void fail(CommandResult result, How how) {
    if (stage_ == Stage::answer && result.outcome == Outcome::timed_out) result.executed = 1;
    result.step = static_cast<std::uint16_t>(done_ + 1);
    end(result, how);
  }

  const Device device_;
  const std::vector<DeviceStep> steps_;
  const Time timeout_;  // of each step
  const std::uint32_t boots_ = impl_.boots;
  Time deadline_{0};
  std::size_t done_ = 0;
  Stage stage_ = Stage::command;
  std::string fields_;
};

void AsyncBoard::start_attach(const Device& device, Duration timeout, CompletionPtr completion) {
  (new AttachSteps(*impl_, device, bounded(timeout), std::move(completion)))->begin();
}

namespace {

bool shares_slot(const Device& a, const Device& b) {
  return a.first_slot() <= b.last_slot() && b.first_slot() <= a.last_slot();
}

bool is_same_device(const Device& a, const Device& b) {
  return a.address() == b.address() && a.description().name == b.description().name;
}

}  // namespace

void AsyncBoard::require_slots(const Device& device) const {
  std::vector<const Device*> others = impl_->attaching;
  for (const Device& each : impl_->devices) others.push_back(&each);
  std::erase_if(others, [&](const Device* each) { return is_same_device(*each, device); });
  const auto holder = [&](const Device& wanted) -> const Device* {
    const auto found = std::find_if(others.begin(), others.end(),
                                    [&](const Device* each) { return shares_slot(*each, wanted); });
    return found == others.end() ? nullptr : *found;
  };
  const Device* const other = holder(device);
  if (other == nullptr) return;

  std::string fix;
  const int slots = device.last_slot() - device.first_slot() + 1;
  for (int slot = 1; fix.empty() && slot + slots - 1 <= i2c_slots; ++slot) {
    const Device moved(device.description(), device.address(), slot);
    if (holder(moved) == nullptr) fix = "use a free slot, " + moved.place() + ", or ";
  }
  fix += "release that device first:";
  for (int slot = other->first_slot(); slot <= other->last_slot(); ++slot) {
    fix += fmt::format(" X:OFF,{}", slot);
  }
  throw Error(ErrorKind::usage, device.place(),
              fmt::format("{} has slot {}", other->text(),
                          std::max(device.first_slot(), other->first_slot())),
              fix);
}

void AsyncBoard::Impl::give_up_slot(const Command& command) {
  if (command.kind != CommandKind::i2c_poll_off) return;
  std::erase_if(devices, [&](const Device& each) {
    return each.first_slot() <= command.channel && command.channel <= each.last_slot();
  });
}

}  // namespace r4
