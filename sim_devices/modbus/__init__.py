"""Modbus as its slaves speak it: functions, and the RTU and TCP framings."""
