"""The hysteresis of one axis from recordings: alone (`bouc_wen`, `prandtl_ishlinskii`) or with all else (`joint`)."""
