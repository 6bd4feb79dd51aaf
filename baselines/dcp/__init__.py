"""DCP-v2 (Wang and Solomon, ICCV 2019): attention between the clouds, soft matches, a closed-form motion."""
