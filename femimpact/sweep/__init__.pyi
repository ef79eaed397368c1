from femimpact.sweep.curve import FrequencyResponse as FrequencyResponse
