// SPDX-License-Identifier: GPL-3.0-or-later
// AsyncBoard::async_attach(): what sets a device up, one step behind the other.
#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "../async_board_impl.hpp"
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
        completion_(std::move(completion)) {}

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
                      {Impl::Waiter::For::answer, id_, result.pnum, impl_.now, deadline_, nullptr});
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
                    {Impl::Waiter::For::time, id_, 0, impl_.now, impl_.now + step().wait, nullptr});
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

  void wait(Ptr self, Impl::Waiter waiter) {
    waiter.completion = std::move(self);
    impl_.enter(How::post, [&] { impl_.waiters.push_back(std::move(waiter)); });
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

void AsyncBoard::start_attach(const Device& device, Duration timeout, CompletionPtr completion) {
  AttachSteps::begin(AttachSteps::Ptr(
      new AttachSteps(*impl_, device, Impl::time_of(timeout), std::move(completion))));
}

}  // namespace r4
