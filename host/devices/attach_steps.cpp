// SPDX-License-Identifier: GPL-3.0-or-later
// AsyncBoard::async_attach(): what sets a device up, one step behind the other.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "../async/async_board_impl.hpp"
#include "device_steps.hpp"

namespace r4 {

// The steps of a device, then its fields. The user's completion is told how the last ended. A failure ends it:
//
//     command --confirmed--> answer --comes, as described--> pause --over--> the next command
//        |                                                                       ^
//        +---- confirmed, of one without an answer (X:POLL, F) ------------------+
class AsyncBoard::AttachSteps final : public Completion {
 public:
  using Ptr = std::unique_ptr<AttachSteps, Destroy>;

  AttachSteps(Impl& impl, Device device, Time timeout, CompletionPtr completion)
      : impl_(impl),
        device_(std::move(device)),
        steps_(steps_of(device_)),
        timeout_(timeout),
        started_(Impl::steady_now()),
        completion_(std::move(completion)) {
    impl_.attaching.push_back(&device_);
  }
  ~AttachSteps() { std::erase(impl_.attaching, &device_); }
  AttachSteps(const AttachSteps&) = delete;
  AttachSteps& operator=(const AttachSteps&) = delete;

  // The command of the step that is to be done now.
  static void begin(Ptr self) {
    AttachSteps& steps = *self;
    steps.stage_ = Stage::command;
    steps.impl_.begin(
        std::move(self),
        [&steps] {
          Impl& impl = steps.impl_;
          steps.deadline_ = impl.now + steps.timeout_;
          const Command command =
              steps.has_step() ? steps.step().command() : Command::fields(Text(steps.fields_));
          return impl.session.send(command, steps.timeout_, impl.now);
        },
        steps.id_);
  }

  void listen(const Cancel& cancel) override {
    id_ = cancel.command();
    completion_->listen(cancel);
  }
  void complete(const CommandResult& result, How how) override {
    Ptr self(this);
    if (result.outcome != Outcome::confirmed) return end(std::move(self), result, how);
    if (impl_.boots != boots_) {  // it has forgotten the steps that were done
      CommandResult cut = result;
      cut.outcome = Outcome::cancelled;
      return end(std::move(self), cut, how);
    }
    switch (stage_) {
      case Stage::command:
        if (has_step() && step().is_answered()) {
          stage_ = Stage::answer;
          return wait(std::move(self),
                      {Impl::Waits::For::answer, id_, result.pnum, impl_.now, deadline_, nullptr});
        }
        break;
      case Stage::answer: {
        const I2cAnswer& answer = impl_.session.state().i2c_answer;
        if (trouble_with(device_, step(), answer)) {
          CommandResult refused = result;
          refused.outcome = Outcome::refused;
          refused.transfer = answer;
          return end(std::move(self), refused, how);
        }
        stage_ = Stage::pause;
        return wait(std::move(self),
                    {Impl::Waits::For::time, id_, 0, impl_.now, impl_.now + step().wait, nullptr});
      }
      case Stage::pause:
        break;
    }
    if (!has_step()) return end(std::move(self), result, how);  // that were the fields
    if (++done_ == steps_.size()) {
      impl_.describe(device_);
      fields_ = fields_with(impl_.session.fields(), device_);
      if (fields_.empty()) return end(std::move(self), result, how);
    }
    begin(std::move(self));
  }
  void destroy() noexcept override { delete this; }

 private:
  enum class Stage : std::uint8_t { command, answer, pause };

  bool has_step() const { return done_ < steps_.size(); }
  const DeviceStep& step() const { return steps_[done_]; }

  void wait(Ptr self, Impl::Waits::Condition waiter) {
    waiter.completion = std::move(self);
    impl_.enter(How::post, [&] { impl_.waits.add(std::move(waiter)); });
  }
  void end(Ptr self, const CommandResult& result, How how) {
    CommandResult whole = result;
    whole.elapsed = Impl::steady_now() - started_;
    if (stage_ == Stage::answer && whole.outcome == Outcome::timed_out) whole.executed = 1;
    if (whole.outcome != Outcome::confirmed) whole.step = static_cast<std::uint16_t>(done_ + 1);
    const CompletionPtr::pointer users = completion_.release();
    self.reset();
    users->complete(whole, how);
  }

  Impl& impl_;  // which owns this
  const Device device_;
  const std::vector<DeviceStep> steps_;
  const Time timeout_;  // of each
  const Time started_;
  const std::uint32_t boots_ = impl_.boots;
  Time deadline_{0};  // of the step that is being done
  std::size_t done_ = 0;
  Stage stage_ = Stage::command;
  std::string fields_;
  Ticket id_ = 0;
  CompletionPtr completion_;
};

void AsyncBoard::require_slots(const Device& device) const { impl_->require_slots(device); }

void AsyncBoard::start_attach(const Device& device, Duration timeout, CompletionPtr completion) {
  AttachSteps::begin(AttachSteps::Ptr(
      new AttachSteps(*impl_, device, Impl::time_of(timeout), std::move(completion))));
}

// --- the slots

namespace {

bool shares_slot(const Device& a, const Device& b) {
  return a.first_slot() <= b.last_slot() && b.first_slot() <= a.last_slot();
}

bool is_same_device(const Device& a, const Device& b) {
  return a.address() == b.address() && a.description().name == b.description().name;
}

}  // namespace

void AsyncBoard::Impl::require_slots(const Device& device) const {
  std::vector<const Device*> others = attaching;
  for (const Device& each : devices) others.push_back(&each);
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
    if (holder(moved) == nullptr) fix = "name a free one, " + moved.place() + ", or ";
  }
  fix += "give the other up first:";
  for (int slot = other->first_slot(); slot <= other->last_slot(); ++slot) {
    fix += fmt::format(" X:OFF,{}", slot);
  }
  throw Error(ErrorKind::usage, device.place(),
              fmt::format("{} has slot {}", other->text(),
                          std::max(device.first_slot(), other->first_slot())),
              fix);
}

void AsyncBoard::Impl::give_up_slot(const Command& command) {
  if (command.kind != CommandKind::i2c_poll || command.count != 0) return;
  std::erase_if(devices, [&](const Device& each) {
    return each.first_slot() <= command.channel && command.channel <= each.last_slot();
  });
}

}  // namespace r4
