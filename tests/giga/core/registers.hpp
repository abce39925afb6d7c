// SPDX-License-Identifier: GPL-3.0-or-later
// The STM32H747's registers that the firmware uses, by their CMSIS names. In the compiler check the
// registers are plain words. In the tests the registers are objects with behaviour.
#pragma once

#include <cstdint>

#ifdef R4_FAKE_CORE
#include "register.hpp"
using R4Register = r4::fake::Register;
#else
using R4Register = volatile std::uint32_t;
#endif

struct GPIO_TypeDef {
  R4Register MODER, OTYPER, OSPEEDR, PUPDR, IDR, ODR, BSRR, LCKR, AFR[2];
};
struct I2C_TypeDef {
  R4Register CR1, CR2, OAR1, OAR2, TIMINGR, TIMEOUTR, ISR, ICR, PECR, RXDR, TXDR;
};
struct USART_TypeDef {
  R4Register CR1, CR2, CR3, BRR, GTPR, RTOR, RQR, ISR, ICR, RDR, TDR, PRESC;
};
struct DAC_TypeDef {
  R4Register CR, SWTRIGR, DHR12R1, DHR12L1, DHR8R1, DHR12R2, DHR12L2, DHR8R2, DHR12RD, DHR12LD,
      DHR8RD, DOR1, DOR2, SR, CCR, MCR;
};
struct ADC_TypeDef {
  R4Register ISR, IER, CR, CFGR, CFGR2, SMPR1, SMPR2, PCSEL, LTR1, HTR1, SQR1, SQR2, SQR3, SQR4, DR;
};
struct FDCAN_GlobalTypeDef {
  R4Register CREL, ENDN, DBTP, TEST, RWD, CCCR, NBTP, TSCC, TSCV, TOCC, TOCV, ECR, PSR, TDCR, IR,
      IE, ILS, ILE, GFC, SIDFC, XIDFC, XIDAM, HPMS, NDAT1, NDAT2, RXF0C, RXF0S, RXF0A, RXBC, RXF1C,
      RXF1S, RXF1A, RXESC, TXBC, TXFQS, TXESC, TXBRP, TXBAR, TXBCR, TXBTO, TXBCF, TXBTIE, TXBCIE,
      TXEFC, TXEFS, TXEFA;
};
struct IWDG_TypeDef {
  R4Register KR, PR, RLR, SR, WINR;
};
struct TIM_TypeDef {
  R4Register CR1, CR2, SMCR, DIER, SR, EGR, CNT, PSC, ARR;
};
struct RCC_TypeDef {
  R4Register D2CCIP1R, D2CCIP2R, RSR, AHB4ENR, APB1LENR, APB1HENR, APB4ENR;
};
struct PWR_TypeDef {
  R4Register CR1;
};
struct RTC_TypeDef {
  R4Register BKP8R, BKP20R, BKP21R, BKP22R, BKP23R;
};
struct USB_OTG_GlobalTypeDef {
  R4Register GRSTCTL;
};
struct USB_OTG_DeviceTypeDef {
  R4Register DAINTMSK, DIEPEMPMSK;
};
struct USB_OTG_INEndpointTypeDef {
  R4Register DIEPCTL, DIEPINT;
};
struct R4FakeUsb {
  USB_OTG_GlobalTypeDef global;
  USB_OTG_DeviceTypeDef device;
  USB_OTG_INEndpointTypeDef in[6];
};
struct SCB_Type {
  R4Register AIRCR, CFSR;
};

extern GPIO_TypeDef r4_fake_gpio[11];
extern I2C_TypeDef r4_fake_i2c2;
extern I2C_TypeDef r4_fake_i2c4;
extern USART_TypeDef r4_fake_usart2;
extern USART_TypeDef r4_fake_uart4;
extern DAC_TypeDef r4_fake_dac1;
extern ADC_TypeDef r4_fake_adc1;
extern FDCAN_GlobalTypeDef r4_fake_fdcan2;
extern IWDG_TypeDef r4_fake_iwdg1;
extern TIM_TypeDef r4_fake_tim7;
extern RCC_TypeDef r4_fake_rcc;
extern PWR_TypeDef r4_fake_pwr;
extern RTC_TypeDef r4_fake_rtc;
extern SCB_Type r4_fake_scb;
extern R4FakeUsb r4_fake_usb;
extern std::uint32_t r4_fake_message_ram[2560];

#define GPIOA (&r4_fake_gpio[0])
#define GPIOB (&r4_fake_gpio[1])
#define GPIOC (&r4_fake_gpio[2])
#define GPIOD (&r4_fake_gpio[3])
#define GPIOE (&r4_fake_gpio[4])
#define GPIOF (&r4_fake_gpio[5])
#define GPIOG (&r4_fake_gpio[6])
#define GPIOH (&r4_fake_gpio[7])
#define GPIOI (&r4_fake_gpio[8])
#define GPIOJ (&r4_fake_gpio[9])
#define GPIOK (&r4_fake_gpio[10])
#define I2C2 (&r4_fake_i2c2)
#define I2C4 (&r4_fake_i2c4)
#define USART2 (&r4_fake_usart2)
#define UART4 (&r4_fake_uart4)
#define DAC1 (&r4_fake_dac1)
#define ADC1 (&r4_fake_adc1)
#define FDCAN2 (&r4_fake_fdcan2)
#define IWDG1 (&r4_fake_iwdg1)
#define TIM7 (&r4_fake_tim7)
#define RCC (&r4_fake_rcc)
#define PWR (&r4_fake_pwr)
#define RTC (&r4_fake_rtc)
#define SCB (&r4_fake_scb)
#define USB_OTG_FS_PERIPH_BASE (reinterpret_cast<std::uintptr_t>(&r4_fake_usb))
#define USB_OTG_DEVICE_BASE (sizeof(USB_OTG_GlobalTypeDef))
#define USB_OTG_IN_ENDPOINT_BASE (sizeof(USB_OTG_GlobalTypeDef) + sizeof(USB_OTG_DeviceTypeDef))
#define USB_OTG_EP_REG_SIZE (sizeof(USB_OTG_INEndpointTypeDef))
#define SRAMCAN_BASE (reinterpret_cast<std::uintptr_t>(r4_fake_message_ram))

enum IRQn_Type {
  HardFault_IRQn = -13,
  MemoryManagement_IRQn = -12,
  BusFault_IRQn = -11,
  UsageFault_IRQn = -10,
  FDCAN2_IT0_IRQn = 20,
  TIM7_IRQn = 55,
  SWPMI1_IRQn = 115,
  MDIOS_IRQn = 120,
};

extern "C" {
std::uint32_t __get_PRIMASK();
void __set_PRIMASK(std::uint32_t mask);
void __disable_irq();
void __enable_irq();
std::uint32_t __get_IPSR();
std::uintptr_t __get_MSP();  // on the chip an address is 32 bits
void __DSB();
void NVIC_SetVector(IRQn_Type line, std::uintptr_t vector);  // the vector is an address
void NVIC_EnableIRQ(IRQn_Type line);
void NVIC_SetPriority(IRQn_Type line, std::uint32_t priority);
void NVIC_SetPendingIRQ(IRQn_Type line);

std::uint32_t HAL_RCC_GetPCLK1Freq();
std::uint32_t HAL_RCC_GetHCLKFreq();
std::uint32_t HAL_RCCEx_GetD3PCLK1Freq();
struct PLL1_ClocksTypeDef {
  std::uint32_t PLL1_P_Frequency, PLL1_Q_Frequency, PLL1_R_Frequency;
};
void HAL_RCCEx_GetPLL1ClockFreq(PLL1_ClocksTypeDef* clocks);
std::uint32_t HAL_GetUIDw0();
std::uint32_t HAL_GetUIDw1();
std::uint32_t HAL_GetUIDw2();
}
